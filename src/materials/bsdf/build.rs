//! How a stack of lobes is made: its frames, its lobes from the base outward, and the layers
//! between them.

use arrayvec::ArrayVec;

use super::{Bsdf, Entry, FrameId, LEAST_COSINE, TransportMode, View};
use crate::color::Rgb;
use crate::geometry::SurfacePoint;
use crate::materials::cover::Cover;
use crate::materials::lobes::{Lobe, LobeModel};
use crate::math::{DVec3, Frame};

impl Bsdf {
    /// A surface that absorbs everything, until lobes are pushed.
    #[inline(always)]
    pub fn new(sp: &SurfacePoint, mode: TransportMode) -> Self {
        let (n, ng) = Self::normals(sp);
        let frame = Frame::from_normal(n);
        Self {
            main: View {
                wo: frame.to_local(sp.wo),
                frame,
            },
            second: None,
            wo_world: sp.wo,
            front: sp.front,
            ng,
            mode,
            lobes: ArrayVec::new(),
            covers: ArrayVec::new(),
            total: 0.0,
            shown: None,
        }
    }

    /// Shading and geometric normal on the side of `wo`.
    #[inline(always)]
    pub(super) fn normals(sp: &SurfacePoint) -> (DVec3, DVec3) {
        let (ng, n) = if sp.front {
            (sp.ng, sp.n)
        } else {
            (-sp.ng, -sp.n)
        };
        // An interpolated normal may face away from a visible point.
        (if sp.wo.dot(n) > 0.0 { n } else { ng }, ng)
    }

    /// Shows a colour, as radiance, to whoever looks at the surface, whatever the light.
    pub fn show(&mut self, color: Rgb) {
        self.shown = Some(color);
    }

    /// The colour that is shown, if the surface is not lit.
    #[inline]
    pub fn shown(&self) -> Option<Rgb> {
        self.shown
    }

    /// The frame around `n`, given on the front of the surface. A normal that faces away from
    /// `wo` is turned until it does not, as no lobe is defined below its horizon.
    fn view_around(&self, n: DVec3, tangent: Option<DVec3>) -> View {
        let mut n = if self.front { n } else { -n };
        let cos = n.dot(self.wo_world);
        if cos < LEAST_COSINE {
            n = (n + self.wo_world * (LEAST_COSINE - cos))
                .try_normalize()
                .unwrap_or(self.ng);
        }
        let frame = tangent
            .and_then(|t| Frame::from_normal_and_tangent(n, t))
            .unwrap_or_else(|| Frame::from_normal(n));
        View {
            wo: frame.to_local(self.wo_world),
            frame,
        }
    }

    /// Takes another shading normal, given on the front of the surface. To be called before
    /// lobes are pushed.
    pub fn set_normal(&mut self, n: DVec3) {
        self.main = self.view_around(n, None);
    }

    /// Turns the frame about its normal, so that its first axis follows `tangent`. To be called
    /// before lobes are pushed.
    pub fn set_tangent(&mut self, tangent: DVec3) {
        let n = self.main.frame.z;
        if let Some(frame) = Frame::from_normal_and_tangent(n, tangent) {
            self.main = View {
                wo: frame.to_local(self.wo_world),
                frame,
            };
        }
    }

    /// A second frame around `n`, given on the front of the surface.
    pub fn add_frame(&mut self, n: DVec3) -> FrameId {
        self.second = Some(self.view_around(n, None));
        FrameId(1)
    }

    /// Adds a lobe; it is picked in proportion to its albedo. A black lobe is left out.
    #[inline]
    pub fn push(&mut self, lobe: impl LobeModel + Into<Lobe>) {
        self.push_in(lobe, FrameId::MAIN, 0);
    }

    /// As [`push`](Self::push), in one of the frames; `events` are
    /// [counted](crate::stats::tally::lobe) whenever it is evaluated.
    #[inline]
    pub fn push_in(&mut self, lobe: impl LobeModel + Into<Lobe>, frame: FrameId, events: u32) {
        let pick = lobe.importance(self.view(frame).wo);
        let entry = Entry {
            lobe: lobe.into(),
            pick,
            frame,
            under: self.covers.len() as u8,
            events,
        };
        if pick > 0.0 {
            let full = self.lobes.try_push(entry).is_err();
            debug_assert!(!full, "more lobes than a material may stack");
            if !full {
                self.total += pick;
            }
        }
    }

    /// Multiplies the relative index of what refracts: the surface parts other media than its
    /// material and air. By 0, where there is no border between media, light passes straight.
    pub fn immerse(&mut self, correction: f64) {
        for e in &mut self.lobes {
            e.lobe.immerse(correction);
        }
    }

    /// Lays a layer over all lobes pushed so far.
    pub(in crate::materials) fn cover(&mut self, cover: Cover, frame: FrameId) {
        let passes = cover.passes(self.view(frame).wo.z);
        if self.covers.try_push((cover, frame)).is_err() {
            debug_assert!(false, "more layers than a material may stack");
            return;
        }
        self.total = 0.0;
        for e in &mut self.lobes {
            e.pick *= passes;
            self.total += e.pick;
        }
    }
}
