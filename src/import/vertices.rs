//! Vertex attributes of a primitive, all of one length.

use std::sync::Arc;

use super::Problem;
use super::accessor::{Accessor, Component, Source};
#[cfg(feature = "draco")]
use super::draco::Draco;
use super::json::Cursor;

/// The vertices of a primitive as single precision; an attribute that is not there is empty.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) tangents: Vec<[f32; 4]>,
    pub(super) uv_sets: Vec<Vec<[f32; 2]>>,
    pub(super) colors: Vec<[f32; 4]>,
    pub(super) radii: Vec<[f32; 1]>,
}

/// Where joints stand in the file, and for each vertex four of them with their weights.
type Influences<'a> = (Cursor<'a>, Vec<[u32; 4]>, Vec<[f32; 4]>);

/// Most sets of one kind of attribute.
pub(super) const MAX_SETS: usize = 16;

/// Where the attributes of a primitive come from.
pub(super) struct Attributes<'s, 'a> {
    pub(super) source: &'s Source<'a>,
    /// The map from names to accessors.
    pub(super) map: Cursor<'a>,
    /// Vertices that the accessors have.
    pub(super) count: usize,
    /// The vertices that are read, in ascending order; all if `None`.
    pub(super) pick: Option<Arc<Vec<u32>>>,
    /// Attributes that are compressed.
    #[cfg(feature = "draco")]
    pub(super) draco: Option<Arc<Draco<'a>>>,
}

impl<'s, 'a> Attributes<'s, 'a> {
    /// The attributes of the same vertices in a morph target, which is never compressed.
    pub(super) fn target(&self, map: Cursor<'a>) -> Attributes<'s, 'a> {
        Attributes {
            source: self.source,
            map,
            count: self.count,
            pick: self.pick.clone(),
            #[cfg(feature = "draco")]
            draco: None,
        }
    }

    fn picked(&self) -> Option<&[u32]> {
        self.pick.as_ref().map(|p| p.as_slice())
    }

    /// Reads all that a surface needs.
    pub(super) fn vertices(&self) -> Result<Vertices, Problem> {
        let ((positions, normals), (rest, uv_sets)) = rayon::join(
            || {
                rayon::join(
                    || self.floats::<3>("POSITION"),
                    || self.floats::<3>("NORMAL"),
                )
            },
            || {
                rayon::join(
                    || Ok::<_, Problem>((self.floats::<4>("TANGENT")?, self.colors("COLOR_0")?)),
                    || self.uv_sets(),
                )
            },
        );
        let (positions, normals) = (positions?, normals?);
        let (tangents, colors) = rest?;
        Ok(Vertices {
            positions,
            normals,
            tangents,
            colors,
            uv_sets: uv_sets?,
            radii: self.floats::<1>("_RADIUS")?,
        })
    }

    /// The accessor of an attribute, if it is there.
    pub(super) fn accessor(&self, name: &str) -> Result<Option<Accessor<'a>>, Problem> {
        let Some(from) = self.map.get(name) else {
            return Ok(None);
        };
        let accessor = self.source.accessor(&from)?;
        if accessor.count != self.count {
            return Err(from.problem(format!(
                "has {} elements for {} positions",
                accessor.count, self.count
            )));
        }
        if accessor.component == Component::U32 {
            return Err(from.problem("is of 32-bit integers, which attributes may not be"));
        }
        Ok(Some(accessor))
    }

    /// An attribute of `N` numbers; empty if it is not there.
    pub(super) fn floats<const N: usize>(&self, name: &str) -> Result<Vec<[f32; N]>, Problem> {
        match self.accessor(name)? {
            Some(a) => self.finite(&a),
            None => Ok(Vec::new()),
        }
    }

    /// What Draco holds of an accessor, if it does.
    #[cfg(feature = "draco")]
    fn compressed<const N: usize>(
        &self,
        a: &Accessor<'a>,
    ) -> Result<Option<Vec<[f32; N]>>, Problem> {
        match &self.draco {
            None => Ok(None),
            Some(draco) => draco.floats::<N>(a),
        }
    }

    /// The values of an accessor, all of which must be numbers.
    fn finite<const N: usize>(&self, a: &Accessor<'a>) -> Result<Vec<[f32; N]>, Problem> {
        #[cfg(feature = "draco")]
        if let Some(values) = self.compressed::<N>(a)? {
            finite(&values, &a.from)?;
            return Ok(values);
        }
        let values = self.source.floats::<N>(a, self.picked())?;
        if a.component == Component::F32 {
            finite(&values, &a.from)?;
        }
        Ok(values)
    }

    /// Colours, linear, with alpha. Integers are normalised, also where the file forgets to say
    /// so (glTF 2.0, 3.7.2.1 allows nothing else).
    fn colors(&self, name: &str) -> Result<Vec<[f32; 4]>, Problem> {
        let Some(mut a) = self.accessor(name)? else {
            return Ok(Vec::new());
        };
        a.normalized = true;
        let mut colors = match a.width {
            3 => {
                let rgb = self.finite::<3>(&a)?;
                rgb.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
            }
            _ => self.finite::<4>(&a)?,
        };
        for c in colors.iter_mut().flatten() {
            *c = c.clamp(0.0, 1.0);
        }
        Ok(colors)
    }

    /// How a morph target changes colours: any numbers, alpha zero where it is not given.
    pub(super) fn color_offsets(&self, name: &str) -> Result<Vec<[f32; 4]>, Problem> {
        match self.accessor(name)? {
            None => Ok(Vec::new()),
            Some(a) if a.width == 3 => {
                let rgb = self.finite::<3>(&a)?;
                Ok(rgb.into_iter().map(|[r, g, b]| [r, g, b, 0.0]).collect())
            }
            Some(a) => self.finite::<4>(&a),
        }
    }

    /// One set of joints and weights, with where the joints stand in the file.
    pub(super) fn influences(&self, set: usize) -> Result<Option<Influences<'a>>, Problem> {
        let (joints, weights) = (format!("JOINTS_{set}"), format!("WEIGHTS_{set}"));
        let Some(accessor) = self.accessor(&joints)? else {
            return Ok(None);
        };
        let from = accessor.from.clone();
        let joints = self.joints(&accessor)?;
        let Some(mut accessor) = self.accessor(&weights)? else {
            return Err(from.problem(format!("has no {weights} beside it")));
        };
        // As for colours, nothing else is allowed of integers.
        accessor.normalized = true;
        let weights = self.finite::<4>(&accessor)?;
        Ok(Some((from, joints, weights)))
    }

    fn joints(&self, a: &Accessor<'a>) -> Result<Vec<[u32; 4]>, Problem> {
        #[cfg(feature = "draco")]
        if let Some(values) = self.compressed::<4>(a)? {
            return Ok(values.into_iter().map(|v| v.map(|x| x as u32)).collect());
        }
        self.source.whole::<4>(a, self.picked())
    }

    fn uv_sets(&self) -> Result<Vec<Vec<[f32; 2]>>, Problem> {
        let mut sets = Vec::new();
        for i in 0..MAX_SETS {
            sets.push(self.floats::<2>(&format!("TEXCOORD_{i}"))?);
        }
        let used = sets
            .iter()
            .rposition(|s| !s.is_empty())
            .map_or(0, |i| i + 1);
        sets.truncate(used);
        Ok(sets)
    }
}

/// Refuses values that are not finite (glTF 2.0, 3.6.2.2 forbids them); `at` is where they are.
pub(super) fn finite<const N: usize>(values: &[[f32; N]], at: &Cursor<'_>) -> Result<(), Problem> {
    // Without a branch, so that it becomes vector code.
    let bad = values
        .iter()
        .flatten()
        .fold(false, |bad, x| bad | !x.is_finite());
    if !bad {
        return Ok(());
    }
    let which = values
        .iter()
        .position(|v| v.iter().any(|x| !x.is_finite()))
        .unwrap_or_default();
    Err(at.problem(format!("element {which} is infinite or not a number")))
}
