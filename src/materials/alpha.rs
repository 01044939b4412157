//! Alpha: where a surface is not there (glTF 2.0, 3.9.4).

use super::{AlphaMode, MaterialDesc};
use crate::geometry::{Coverage, Shape};
use crate::textures::Texture;

/// Alpha of the base colour's factor, texture and vertices.
pub(super) struct Alpha {
    factor: f64,
    texture: Option<Texture>,
    vertex_colors: bool,
    /// Below which nothing is there, and from which on everything; none for a share.
    cutoff: Option<f64>,
}

impl Alpha {
    /// The alpha of a material; `None` if it is whole everywhere.
    pub(super) fn new(d: &MaterialDesc) -> Option<Self> {
        let cutoff = match d.alpha_mode {
            AlphaMode::Opaque => return None,
            AlphaMode::Mask { cutoff } => Some(cutoff),
            AlphaMode::Blend => None,
        };
        let texture = d
            .textures
            .as_ref()
            .and_then(|t| t.base_color.as_ref().or(t.diffuse.as_ref()))
            .filter(|t| t.range()[0][3] < 1.0)
            .cloned();
        let alpha = Self {
            factor: d.base_alpha,
            texture,
            vertex_colors: d.vertex_colors,
            cutoff,
        };
        let uniform = alpha.texture.is_none() && !alpha.vertex_colors;
        (!uniform || alpha.decide(alpha.factor) < 1.0).then_some(alpha)
    }

    fn decide(&self, alpha: f64) -> f64 {
        match self.cutoff {
            Some(cutoff) => f64::from(u8::from(alpha >= cutoff)),
            None => alpha,
        }
    }
}

impl Coverage for Alpha {
    fn opacity(&self, shape: &Shape, prim: u32, barycentrics: [f64; 2]) -> f64 {
        let mut alpha = self.factor;
        match shape {
            Shape::Mesh(mesh) => {
                if self.vertex_colors
                    && let Some(c) = mesh.interpolate(&mesh.colors, prim, barycentrics)
                {
                    alpha *= c[3];
                }
                if let Some(texture) = &self.texture {
                    let uv = mesh.uv(texture.uv_set, prim, barycentrics);
                    alpha *= texture.lookup(uv, None)[3];
                }
            }
            // A point of a sphere is not known here.
            Shape::Spheres(_) => {
                if let Some(texture) = &self.texture {
                    alpha *= texture.mean()[3];
                }
            }
        }
        self.decide(alpha)
    }
}
