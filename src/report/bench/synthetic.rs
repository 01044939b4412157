//! Scenes of any size, made up: as glTF files, so that importing them is measured too.

use std::f32::consts::{FRAC_1_SQRT_2, TAU};

use serde_json::json;

use super::glb::Glb;
use crate::error::{Error, Result};
use crate::math::{DMat3, DQuat, DVec3};
use crate::sampling::{Rng, warp};

/// A made-up scene: kind and number of primitives as seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Synthetic {
    /// Which.
    pub kind: &'static Kind,
    /// Triangles or spheres, about.
    pub size: u64,
}

/// A kind of made-up scenes.
#[derive(Debug)]
pub struct Kind {
    /// Name.
    pub name: &'static str,
    /// One sentence.
    pub doc: &'static str,
    fill: fn(&mut Glb, u64) -> usize,
}

impl PartialEq for Kind {
    fn eq(&self, o: &Self) -> bool {
        self.name == o.name
    }
}

/// The kinds.
pub static KINDS: &[Kind] = &[
    Kind {
        name: "terrain",
        doc: "one mesh of hills",
        fill: terrain,
    },
    Kind {
        name: "forest",
        doc: "instances of one tree",
        fill: forest,
    },
    Kind {
        name: "spheres",
        doc: "a cloud of spheres",
        fill: spheres,
    },
    Kind {
        name: "soup",
        doc: "triangles anywhere, at any angle",
        fill: soup,
    },
];

impl Synthetic {
    /// As typed: `terrain:20M`. `count` understands the number.
    ///
    /// # Errors
    /// What to type.
    pub fn parse(s: &str, count: impl Fn(&str) -> Result<u64, String>) -> Result<Self, String> {
        let names = || KINDS.iter().map(|k| k.name).collect::<Vec<_>>().join(", ");
        let (name, size) = s.split_once(':').ok_or_else(|| {
            format!(
                "type KIND:N, for instance terrain:1M; kinds are {}",
                names()
            )
        })?;
        let kind = KINDS
            .iter()
            .find(|k| k.name == name)
            .ok_or_else(|| format!("no kind is called '{name}'; known: {}", names()))?;
        match count(size)? {
            0..100 => Err("takes at least 100 primitives, for instance 10k".into()),
            n => Ok(Self { kind, size: n }),
        }
    }

    /// The file. The scene fills a cube from −1 to 1 above the plane y = 0, under a sun and a
    /// faint lamp, seen from above its edge.
    ///
    /// # Errors
    /// More than a glTF file can hold.
    pub fn glb(&self) -> Result<Vec<u8>> {
        let eye = DVec3::new(1.1, 1.2, 1.9);
        let mut glb = Glb::new(json!({
            "asset": {"version": "2.0", "generator": "dualight bench"},
            "extensionsUsed": ["KHR_lights_punctual", "EXT_mesh_gpu_instancing"],
            "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
            "cameras": [{"type": "perspective", "perspective":
                {"yfov": 0.7, "znear": 0.01, "aspectRatio": 1.0}}],
            "extensions": {"KHR_lights_punctual": {"lights": [
                {"type": "directional", "intensity": 2000.0}]}},
            "materials": [{"name": "clay", "pbrMetallicRoughness":
                {"baseColorFactor": [0.6, 0.55, 0.5, 1.0], "metallicFactor": 0.0,
                 "roughnessFactor": 1.0}}],
        }));
        let turned = |to: DVec3| looking(to).to_array();
        glb.add(
            "nodes",
            json!({"camera": 0, "translation": eye.to_array(),
                   "rotation": turned(DVec3::new(0.0, 0.2, 0.0) - eye)}),
        );
        glb.add(
            "nodes",
            json!({"extensions": {"KHR_lights_punctual": {"light": 0}},
                   "rotation": turned(DVec3::new(0.3, -1.0, -0.4))}),
        );
        let node = (self.kind.fill)(&mut glb, self.size);
        debug_assert_eq!(node, 2);
        glb.finish().ok_or_else(|| {
            Error::Usage(format!(
                "{}:{} is more than the 4 GiB of a .glb file; ask for fewer",
                self.kind.name, self.size
            ))
        })
    }
}

impl std::fmt::Display for Synthetic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let n = self.size;
        match n {
            _ if n.is_multiple_of(1_000_000) => write!(f, "{}:{}M", self.kind.name, n / 1_000_000),
            _ if n.is_multiple_of(1_000) => write!(f, "{}:{}k", self.kind.name, n / 1_000),
            _ => write!(f, "{}:{n}", self.kind.name),
        }
    }
}

/// The rotation after which −z points to `to`, and y up.
fn looking(to: DVec3) -> DQuat {
    let back = -to.normalize();
    let right = DVec3::Y.cross(back).normalize();
    DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back))
}

fn mesh_node(glb: &mut Glb, positions: &[[f32; 3]], indices: &[[u32; 3]]) -> usize {
    let p = glb.vectors(positions);
    let i = glb.indices(indices);
    let mesh = glb.add(
        "meshes",
        json!({"primitives": [{"attributes": {"POSITION": p}, "indices": i, "material": 0}]}),
    );
    glb.add("nodes", json!({"mesh": mesh}))
}

/// Height of the ground: waves of many sizes.
fn ground(x: f32, z: f32) -> f32 {
    let mut h = 0.0;
    for k in 0..7_i32 {
        let f = 2.1_f32.powi(k);
        h += ((x * 2.3 + z * 0.7) * f + k as f32).sin() * ((z * 1.9 - x * 0.6) * f).cos() / f;
    }
    0.12 * (h + 1.6)
}

fn terrain(glb: &mut Glb, size: u64) -> usize {
    let n = ((size as f64 / 2.0).sqrt().round() as u32).max(2);
    let at = |i: u32| i as f32 / n as f32 * 2.0 - 1.0;
    let positions: Vec<[f32; 3]> = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| (at(i), at(j))))
        .map(|(x, z)| [x, ground(x, z), z])
        .collect();
    let w = n + 1;
    let indices: Vec<[u32; 3]> = (0..n)
        .flat_map(|j| (0..n).map(move |i| j * w + i))
        .flat_map(|a| [[a, a + w, a + w + 1], [a, a + w + 1, a + 1]])
        .collect();
    mesh_node(glb, &positions, &indices)
}

/// Triangles of the tree.
const LEAVES: u64 = 2000;

fn forest(glb: &mut Glb, size: u64) -> usize {
    let mut rng = Rng::new(3);
    let trees = size.div_ceil(LEAVES);
    // As wide as its share of the ground.
    let scale = (2.0 / (trees as f32).sqrt()).min(0.5);
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for k in 0..LEAVES as u32 {
        // Leaves in a cone.
        let h = rng.next_1d() as f32;
        let r = 0.5 * (1.0 - h) * (rng.next_1d() as f32).sqrt();
        let phi = TAU * rng.next_1d() as f32;
        let c = [r * phi.cos(), 0.3 + 1.7 * h, r * phi.sin()];
        leaf(c, 0.05, &mut rng, &mut positions);
        indices.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    let p = glb.vectors(&positions);
    let i = glb.indices(&indices);
    let mesh = glb.add(
        "meshes",
        json!({"primitives": [{"attributes": {"POSITION": p}, "indices": i, "material": 0}]}),
    );
    let (mut places, mut turns) = (Vec::new(), Vec::new());
    for _ in 0..trees {
        let [x, z] = rng.next_2d().map(|u| 2.0 * u as f32 - 1.0);
        places.push([x, ground(x, z) * 0.3, z]);
        let half = 0.5 * TAU * rng.next_1d() as f32;
        turns.push([0.0, half.sin(), 0.0, half.cos()]);
    }
    let sizes: Vec<[f32; 3]> = (0..trees)
        .map(|_| [scale * (0.7 + 0.6 * rng.next_1d() as f32); 3])
        .collect();
    let (t, r, s) = (
        glb.vectors(&places),
        glb.vectors(&turns),
        glb.vectors(&sizes),
    );
    glb.add(
        "nodes",
        json!({"mesh": mesh, "extensions": {"EXT_mesh_gpu_instancing": {"attributes":
            {"TRANSLATION": t, "ROTATION": r, "SCALE": s}}}}),
    )
}

/// A triangle about a point, turned at random.
fn leaf(c: [f32; 3], size: f32, rng: &mut Rng, positions: &mut Vec<[f32; 3]>) {
    for _ in 0..3 {
        let d = warp::sphere(rng.next_2d()).as_vec3() * size;
        positions.push([c[0] + d.x, c[1] + d.y, c[2] + d.z]);
    }
}

fn spheres(glb: &mut Glb, size: u64) -> usize {
    let mut rng = Rng::new(5);
    let radius = 0.6 / (size as f32).cbrt();
    let mut centre = || [0; 3].map(|_: i32| 2.0 * rng.next_1d() as f32 - 1.0);
    let centres: Vec<[f32; 3]> = (0..size)
        .map(|_| centre())
        .map(|[x, y, z]| [x, y * 0.5 + 0.5, z])
        .collect();
    let radii: Vec<[f32; 1]> = (0..size)
        .map(|k| [radius * (1.0 + FRAC_1_SQRT_2 * (k as f32).sin())])
        .collect();
    let (p, r) = (glb.vectors(&centres), glb.vectors(&radii));
    let mesh = glb.add(
        "meshes",
        json!({"primitives": [{"mode": 0, "attributes": {"POSITION": p, "_RADIUS": r},
                               "material": 0}]}),
    );
    glb.add("nodes", json!({"mesh": mesh}))
}

fn soup(glb: &mut Glb, size: u64) -> usize {
    let mut rng = Rng::new(7);
    let edge = 1.2 / (size as f32).cbrt();
    let mut positions = Vec::with_capacity(3 * size as usize);
    for _ in 0..size {
        let c = [0; 3].map(|_: i32| 2.0 * rng.next_1d() as f32 - 1.0);
        leaf(
            [c[0], c[1] * 0.5 + 0.5, c[2]],
            edge,
            &mut rng,
            &mut positions,
        );
    }
    let indices: Vec<[u32; 3]> = (0..size as u32)
        .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
        .collect();
    mesh_node(glb, &positions, &indices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{self, ImportOptions};
    use crate::scene::{Census, ScenePlugins};

    #[test]
    fn scenes_have_about_the_size_that_was_asked_for() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("s.glb");
        for kind in KINDS {
            let synthetic = Synthetic { kind, size: 10_000 };
            std::fs::write(&path, synthetic.glb().unwrap()).unwrap();
            let scene =
                import::load(&path, &ImportOptions::default(), ScenePlugins::default()).unwrap();
            assert_eq!(scene.warnings, Vec::<String>::new(), "{}", kind.name);
            let census = Census::new(&scene);
            let n = census.placed_triangles + census.spheres;
            assert!((9_800..=10_200).contains(&n), "{}: {n}", kind.name);
            assert_eq!((scene.cameras.len(), scene.lights.len()), (1, 1));
        }
    }

    #[test]
    fn what_is_typed_is_understood_or_explained() {
        let parse = |s: &str| Synthetic::parse(s, |n| n.parse().map_err(|_| "number".into()));
        assert_eq!(parse("soup:5000").unwrap().to_string(), "soup:5k");
        for (s, part) in [
            ("soup", "KIND:N"),
            ("stew:500", "terrain, forest"),
            ("soup:x", "number"),
            ("soup:3", "at least"),
        ] {
            assert!(parse(s).unwrap_err().contains(part), "{s}");
        }
    }
}
