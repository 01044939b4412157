//! Skins (glTF 2.0, 3.7.3): vertices carried along by joints.

use super::Problem;
use super::accessor::Source;
use super::json::Cursor;
use super::vertices::{Attributes, MAX_SETS, Vertices};
use crate::math::{DAffine3, DMat3, DMat4, DVec3, Vec3};

/// What the joints of a skin do to vertices, at one moment.
pub(super) struct Skin {
    /// For each joint, from the mesh's space to the world less `center`.
    joints: Vec<DAffine3>,
    /// Where the skinned mesh stands: near its joints, so that single precision serves.
    pub(super) center: DVec3,
}

impl Skin {
    /// Reads the skin that `at` names; `world_of` tells where a node stands.
    pub(super) fn read<'a>(
        at: &Cursor<'a>,
        source: &Source<'a>,
        mut world_of: impl FnMut(&Cursor<'a>) -> Result<DAffine3, Problem>,
    ) -> Result<Self, Problem> {
        let skin = source.root.element("skins", at.index()?, at)?;
        let joints = skin.need("joints")?.elements()?;
        if joints.is_empty() {
            return Err(skin.problem("has no joints"));
        }
        let inverse = match skin.get("inverseBindMatrices") {
            None => vec![DAffine3::IDENTITY; joints.len()],
            Some(at) => {
                let matrices = source.floats::<16>(&source.accessor(&at)?, None)?;
                if matrices.len() < joints.len() {
                    return Err(at.problem(format!(
                        "has {} matrices for {} joints",
                        matrices.len(),
                        joints.len()
                    )));
                }
                if matrices.iter().flatten().any(|x| !x.is_finite()) {
                    return Err(at.problem("holds values that are infinite or not a number"));
                }
                let affine =
                    |m: [f32; 16]| DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from)));
                matrices.into_iter().map(affine).collect()
            }
        };
        let mut worlds = Vec::with_capacity(joints.len());
        for joint in &joints {
            worlds.push(world_of(joint)?);
        }
        let sum: DVec3 = worlds.iter().map(|w| w.translation).sum();
        let center = sum / worlds.len() as f64;
        let center = if center.is_finite() {
            center
        } else {
            DVec3::ZERO
        };
        Ok(Self {
            joints: worlds
                .iter()
                .zip(inverse)
                .map(|(w, i)| DAffine3::from_translation(-center) * *w * i)
                .collect(),
            center,
        })
    }

    /// Carries the vertices of a primitive; `true` if they were mirrored, so that triangles must
    /// turn over.
    pub(super) fn apply(
        &self,
        attributes: &Attributes<'_, '_>,
        v: &mut Vertices,
    ) -> Result<bool, Problem> {
        let blends = self.blends(attributes, v.positions.len())?;
        for (i, m) in blends.iter().enumerate() {
            let p = Vec3::from(v.positions[i]).as_dvec3();
            v.positions[i] = m.transform_point3(p).as_vec3().into();
            if let Some(n) = v.normals.get_mut(i) {
                let turned = cofactor(&m.matrix3) * Vec3::from(*n).as_dvec3();
                let sign = m.matrix3.determinant().signum();
                *n = (turned.normalize_or_zero() * sign).as_vec3().into();
            }
            if let Some(t) = v.tangents.get_mut(i) {
                let along = Vec3::new(t[0], t[1], t[2]).as_dvec3();
                let along = m.transform_vector3(along).normalize_or_zero().as_vec3();
                let sign = m.matrix3.determinant().signum() as f32;
                *t = [along.x, along.y, along.z, t[3] * sign];
            }
            if let Some([r]) = v.radii.get_mut(i) {
                *r *= m.matrix3.determinant().abs().cbrt() as f32;
            }
        }
        let mirrors = |m: &DAffine3| m.matrix3.determinant() < 0.0;
        Ok(!blends.is_empty() && blends.iter().all(mirrors))
    }

    /// For each vertex, the weighted mean of what its joints do, over all sets of influences.
    fn blends(&self, attributes: &Attributes<'_, '_>, n: usize) -> Result<Vec<DAffine3>, Problem> {
        let zero = DAffine3 {
            matrix3: DMat3::ZERO,
            translation: DVec3::ZERO,
        };
        let mut blends = vec![zero; n];
        let mut sums = vec![0.0; n];
        let mut firsts = vec![0u32; n];
        for set in 0..MAX_SETS {
            let Some((from, joints, weights)) = attributes.influences(set)? else {
                if set == 0 {
                    let place = &attributes.map;
                    return Err(place.problem("has no JOINTS_0 and WEIGHTS_0, but a skin"));
                }
                break;
            };
            for i in 0..n {
                if set == 0 {
                    firsts[i] = joints[i][0];
                }
                for (&joint, &weight) in joints[i].iter().zip(&weights[i]) {
                    // Weights below zero are not allowed, and unused joints have none.
                    if !(weight > 0.0) {
                        continue;
                    }
                    let m = self.joint(joint, &from)?;
                    let weight = f64::from(weight);
                    blends[i].matrix3 += m.matrix3 * weight;
                    blends[i].translation += m.translation * weight;
                    sums[i] += weight;
                }
            }
        }
        for (i, sum) in sums.into_iter().enumerate() {
            blends[i] = if sum > 0.0 {
                DAffine3 {
                    matrix3: blends[i].matrix3 * (1.0 / sum),
                    translation: blends[i].translation / sum,
                }
            } else {
                // A vertex that nothing holds goes with the joint it names first.
                self.joints
                    .get(firsts[i] as usize)
                    .copied()
                    .unwrap_or(DAffine3::IDENTITY)
            };
        }
        Ok(blends)
    }

    fn joint(&self, joint: u32, from: &Cursor<'_>) -> Result<&DAffine3, Problem> {
        self.joints.get(joint as usize).ok_or_else(|| {
            from.problem(format!(
                "joint {joint} is out of range: the skin has {}",
                self.joints.len()
            ))
        })
    }
}

/// `det M · M⁻ᵀ`, which exists for singular maps too.
fn cofactor(m: &DMat3) -> DMat3 {
    DMat3::from_cols(
        m.y_axis.cross(m.z_axis),
        m.z_axis.cross(m.x_axis),
        m.x_axis.cross(m.y_axis),
    )
}
