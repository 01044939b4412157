//! Surface points and materials for tests of scattering, without a scene.

use dualight::color::Rgb;
use dualight::geometry::{MaterialId, ObjectId, Surface, SurfacePoint};
use dualight::materials::{Bsdf, MATERIALS, Material, MaterialDesc, TransportMode};
use dualight::math::DVec3;

/// A point of the plane `z = 0` seen along `wo`, with shading normal `n`.
pub fn point_with_normal(wo: DVec3, n: DVec3) -> SurfacePoint {
    SurfacePoint {
        p: DVec3::ZERO,
        ng: DVec3::Z,
        n,
        wo,
        front: wo.z > 0.0,
        distance: 1.0,
        barycentrics: [0.0; 2],
        offset: 0.0,
        prim: 0,
        object: ObjectId(0),
        material: MaterialId(0),
        light: None,
    }
}

/// A point of the plane `z = 0` seen along `wo`.
pub fn point(wo: DVec3) -> SurfacePoint {
    point_with_normal(wo, DVec3::Z)
}

/// The direction at the cosine `cos` to `z`, turned by `phi`; `cos < 0` is behind.
pub fn direction(cos: f64, phi: f64) -> DVec3 {
    let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
    DVec3::new(sin * phi.cos(), sin * phi.sin(), cos)
}

/// A material to test, with what the tests must know of it.
pub struct Specimen {
    pub name: String,
    pub material: Box<dyn Material>,
    pub desc: MaterialDesc,
    /// Whether the back is worth looking at.
    pub both_sides: bool,
}

impl Specimen {
    /// The scattering function seen along `wo`.
    pub fn bsdf(&self, wo: DVec3, mode: TransportMode) -> Bsdf {
        self.material.bsdf(&Surface::bare(&point(wo)), mode)
    }
}

/// Every material kind of the table in several versions, at the given roughnesses where it has
/// one. A kind that is added to the table is tested with general parameters.
pub fn specimens(roughnesses: &[f64]) -> Vec<Specimen> {
    let base = |roughness: f64| MaterialDesc {
        roughness,
        base_color: Rgb::new(0.8, 0.5, 0.2),
        ..Default::default()
    };
    let mut out = Vec::new();
    for entry in MATERIALS {
        let mut add = |what: &str, both_sides: bool, desc: MaterialDesc| {
            out.push(Specimen {
                name: format!("{} {what}", entry.name),
                material: (entry.build)(&desc).expect("valid parameters"),
                desc,
                both_sides,
            });
        };
        match entry.name {
            "lambert" => add(
                "",
                false,
                MaterialDesc {
                    specular: 0.0,
                    metallic: 0.0,
                    ..base(1.0)
                },
            ),
            "mirror" => add("", false, base(0.0)),
            "conductor" => {
                for &r in roughnesses {
                    add(&format!("roughness {r}"), false, base(r));
                }
            }
            "dielectric" => {
                let glass = |r| MaterialDesc {
                    metallic: 0.0,
                    transmission: 1.0,
                    volume: true,
                    base_color: Rgb::ONE,
                    ..base(r)
                };
                add("smooth", true, glass(0.0));
                add(
                    "thin",
                    true,
                    MaterialDesc {
                        volume: false,
                        ..glass(0.0)
                    },
                );
                for &r in roughnesses {
                    add(&format!("roughness {r}"), true, glass(r));
                }
            }
            _ => {
                for &r in roughnesses {
                    let plastic = MaterialDesc {
                        metallic: 0.0,
                        ..base(r)
                    };
                    let mixed = MaterialDesc {
                        metallic: 0.5,
                        ..base(r)
                    };
                    let milk = MaterialDesc {
                        transmission: 0.6,
                        volume: true,
                        metallic: 0.2,
                        ..base(r)
                    };
                    add(&format!("plastic, roughness {r}"), false, plastic);
                    add(&format!("half metal, roughness {r}"), false, mixed);
                    add(&format!("half glass, roughness {r}"), true, milk);
                    let plastic = || MaterialDesc {
                        metallic: 0.0,
                        ..base(r)
                    };
                    let layers = [
                        (
                            "coated",
                            MaterialDesc {
                                clearcoat: 0.9,
                                clearcoat_roughness: 0.2,
                                ..plastic()
                            },
                        ),
                        (
                            "coated metal",
                            MaterialDesc {
                                clearcoat: 1.0,
                                clearcoat_roughness: 0.0,
                                ..base(r)
                            },
                        ),
                        (
                            "velvet",
                            MaterialDesc {
                                sheen_color: Rgb::new(1.0, 0.6, 0.3),
                                sheen_roughness: r,
                                ..plastic()
                            },
                        ),
                        (
                            "brushed metal",
                            MaterialDesc {
                                anisotropy: 0.8,
                                ..base(r)
                            },
                        ),
                        (
                            "soap",
                            MaterialDesc {
                                iridescence: 1.0,
                                iridescence_ior: 1.4,
                                ..plastic()
                            },
                        ),
                        (
                            "specular and glossiness",
                            MaterialDesc {
                                specular_reflectance: Some(Rgb::new(0.5, 0.4, 0.3)),
                                ..plastic()
                            },
                        ),
                    ];
                    for (what, desc) in layers {
                        add(&format!("{what}, roughness {r}"), false, desc);
                    }
                    let through = [
                        (
                            "leaf",
                            MaterialDesc {
                                diffuse_transmission: 0.4,
                                diffuse_transmission_color: Rgb::new(0.3, 1.0, 0.2),
                                ..plastic()
                            },
                        ),
                        (
                            "frosted pane",
                            MaterialDesc {
                                transmission: 1.0,
                                specular: 0.5,
                                ..plastic()
                            },
                        ),
                    ];
                    let filmed = |volume| MaterialDesc {
                        transmission: 1.0,
                        volume,
                        iridescence: 0.8,
                        ..plastic()
                    };
                    let filmed = [
                        ("filmed glass", filmed(true)),
                        ("filmed pane", filmed(false)),
                    ];
                    for (what, desc) in through.into_iter().chain(filmed) {
                        add(&format!("{what}, roughness {r}"), true, desc);
                    }
                }
            }
        }
    }
    out
}
