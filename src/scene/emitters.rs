//! Objects that emit, as lights.

use std::sync::Arc;

use super::builder::Emission;
use crate::color::Rgb;
use crate::geometry::{Geometry, Object, ObjectId, Shape};
use crate::lights::{EmissionMap, LightDesc};
use crate::math::{BoundingSphere, DAffine3};

/// Lets the strength of a surface that emits follow its texture and its alpha. Spheres take
/// their means.
pub(super) fn vary(
    desc: &mut LightDesc,
    geometry: &Geometry,
    object: &Object,
    emission: &Emission,
) {
    if emission.texture.is_none() && object.coverage.is_none() {
        return;
    }
    let shape = geometry.shape(object.shape);
    match shape {
        Shape::Mesh(_) => {
            desc.map = Some(EmissionMap {
                shape: Arc::new(shape.clone()),
                texture: emission.texture.clone(),
                coverage: object.coverage.clone(),
            });
        }
        Shape::Spheres(_) => {
            if let Some(texture) = &emission.texture {
                let [r, g, b, _] = texture.mean();
                desc.strength *= Rgb::new(r, g, b);
            }
        }
    }
}

/// World-space triangles or spheres of an emitting object.
pub(super) fn surface_light(geometry: &Geometry, id: ObjectId) -> LightDesc {
    let object = geometry.object(id);
    let world = object
        .placement
        .map_or(DAffine3::IDENTITY, |p| p.world_from_object);
    // Mirrored triangles turn over, so that their front stays the front.
    let flip = world.matrix3.determinant() < 0.0;
    match geometry.shape(object.shape) {
        Shape::Mesh(mesh) => LightDesc {
            kind: "area",
            triangles: (0..mesh.indices.len() as u32)
                .map(|i| {
                    let [a, b, c] = mesh.corners(i).map(|p| world.transform_point3(p));
                    if flip { [a, c, b] } else { [a, b, c] }
                })
                .collect(),
            ..Default::default()
        },
        Shape::Spheres(set) => LightDesc {
            // Spheres that stay round are in world space already.
            kind: if object.placement.is_some() {
                "ellipsoid"
            } else {
                "sphere"
            },
            spheres: (0..set.spheres.len() as u32)
                .map(|i| {
                    let (center, radius) = set.get(i);
                    BoundingSphere { center, radius }
                })
                .collect(),
            world,
            ..Default::default()
        },
    }
}
