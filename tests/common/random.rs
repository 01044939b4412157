//! Scenes at random, of which every feature may be on or off.

use std::sync::Arc;

use dualight::cameras::CameraDesc;
use dualight::color::Rgb;
use dualight::geometry::{MaterialId, TriangleMesh};
use dualight::materials::{AlphaMode, MaterialDesc, TextureSlots};
use dualight::math::{DAffine3, DVec3};
use dualight::sampling::Rng;
use dualight::scene::{MeshPlacement, Omit, Scene, SceneBuilder};
use dualight::textures::{Content, Image, Texels, Texture};

use super::{add_room, add_sphere, camera, lambert, lamp, light, round_lens, square};

/// An image of 4 × 4 texels, each channel all 0, all 255 or of both.
fn texture(rng: &mut Rng, content: Content) -> Option<Texture> {
    if rng.next_1d() < 0.5 {
        return None;
    }
    let kinds: [u64; 4] = std::array::from_fn(|_| rng.next_u64() % 3);
    let texels = (0..16 * 4)
        .map(|i| match kinds[i % 4] {
            0 => 0,
            1 => 255,
            _ => 255 * (rng.next_u64() % 2) as u8,
        })
        .collect();
    let image = Image::from_texels(4, 4, 4, Texels::U8(texels)).unwrap();
    Some(Texture::new(Arc::new(image), content))
}

/// A glTF material of which everything may be on or off, by factor and by texture.
pub fn material(rng: &mut Rng) -> MaterialDesc {
    let toss = |rng: &mut Rng| f64::from(u8::from(rng.next_1d() < 0.5));
    let rarely = |rng: &mut Rng| f64::from(u8::from(rng.next_1d() < 0.25));
    let rare = |rng: &mut Rng, content| match rng.next_1d() < 0.25 {
        true => texture(rng, content),
        false => None,
    };
    let slots = TextureSlots {
        base_color: texture(rng, Content::Color),
        metallic_roughness: texture(rng, Content::Data),
        transmission: texture(rng, Content::Data),
        specular: texture(rng, Content::Data),
        clearcoat: texture(rng, Content::Data),
        sheen_color: texture(rng, Content::Color),
        normal: rare(rng, Content::Data),
        normal_scale: toss(rng),
        clearcoat_normal: rare(rng, Content::Data),
        clearcoat_normal_scale: 0.5,
        iridescence: rare(rng, Content::Data),
        anisotropy: rare(rng, Content::Data),
        diffuse_transmission: rare(rng, Content::Data),
        ..Default::default()
    };
    MaterialDesc {
        name: "random".into(),
        base_color: Rgb::splat(0.8 * toss(rng)),
        metallic: toss(rng),
        roughness: 0.6 * toss(rng),
        transmission: 0.7 * toss(rng),
        volume: rng.next_1d() < 0.5,
        specular: toss(rng),
        clearcoat: toss(rng),
        sheen_color: Rgb::splat(0.5 * toss(rng)),
        attenuation_distance: if rng.next_1d() < 0.5 {
            0.7
        } else {
            f64::INFINITY
        },
        attenuation_color: Rgb::new(1.0, 1.0 - 0.5 * toss(rng), 1.0),
        dispersion: 3.0 * rarely(rng),
        diffuse_transmission: 0.6 * rarely(rng),
        iridescence: rarely(rng),
        anisotropy: 0.8 * rarely(rng),
        textures: Some(Arc::new(slots)),
        ..Default::default()
    }
}

/// A square of side 2 around `c`, with texture coordinates, that looks along `+z`.
pub fn add_square(b: &mut SceneBuilder, material: MaterialId, c: DVec3) {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mesh = TriangleMesh {
        positions: corners
            .map(|[x, y]| (c + DVec3::new(x, y, 0.0)).as_vec3().into())
            .to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        uv_sets: vec![corners.map(|v| v.map(|x| x as f32)).to_vec()],
        ..Default::default()
    };
    let shape = b.add_mesh(mesh, "square");
    b.place(MeshPlacement {
        shape,
        material,
        world_from_object: DAffine3::IDENTITY,
        name: "square".into(),
    });
}

/// Alpha, now and then: too little of it to be seen, or a half.
fn with_alpha(rng: &mut Rng, mut d: MaterialDesc) -> MaterialDesc {
    d.alpha_mode = match rng.next_u64() % 6 {
        0 => AlphaMode::Blend,
        1 => AlphaMode::Mask { cutoff: 0.5 },
        _ => AlphaMode::Opaque,
    };
    d.base_alpha = if rng.next_1d() < 0.5 { 1.0 } else { 0.6 };
    d
}

/// A room in which everything may be there or not, without what `omit` says.
pub fn scene(seed: u64, omit: Omit) -> Scene {
    let rng = &mut Rng::new(seed);
    let mut b = SceneBuilder::default();
    b.leave_out(omit);
    let walls = match rng.next_u64() % 3 {
        0 => b.add_material(&material(rng)),
        1 => b.add_material(&lambert("black", Rgb::ZERO)),
        _ => b.add_material(&lambert("grey", Rgb::splat(0.5))),
    };
    let other = material(rng);
    let other = with_alpha(rng, other);
    let (walls, other) = (walls.unwrap(), b.add_material(&other).unwrap());
    if rng.next_1d() < 0.7 {
        add_room(&mut b, walls, 3.0);
    } else {
        add_square(&mut b, walls, DVec3::new(0.5, 0.5, -2.0));
    }
    add_square(&mut b, other, DVec3::new(0.0, 0.0, -1.0));
    if rng.next_1d() < 0.5 {
        add_sphere(&mut b, "ball", other, DVec3::new(-0.8, -0.5, 0.0), 0.7);
    }
    if rng.next_1d() < 0.3 {
        let shape = b.add_mesh(square(), "twice");
        for x in [-1.5, 1.5] {
            b.place(MeshPlacement {
                shape,
                material: other,
                world_from_object: DAffine3::from_translation(DVec3::new(x, 0.5, -1.5)),
                name: "twice".into(),
            });
        }
    }
    if rng.next_1d() < 0.5 {
        b.add_light(light("point", DVec3::new(0.5, 1.0, 1.0), DVec3::Y, 3.0));
    }
    if rng.next_1d() < 0.5 {
        let glowing = b.add_material(&lamp(Rgb::splat(2.0))).unwrap();
        add_square(&mut b, glowing, DVec3::new(1.5, 1.5, -2.0));
    }
    if rng.next_1d() < 0.3 {
        b.add_light(light("environment", DVec3::ZERO, DVec3::Y, 0.5));
    }
    let lens = (rng.next_1d() < 0.4).then(|| {
        let radius = if rng.next_1d() < 0.5 { 0.1 } else { 0.0 };
        round_lens(radius, 2.0)
    });
    b.add_camera(CameraDesc {
        lens,
        ..camera(DVec3::new(0.0, 0.0, 2.5), 60.0)
    });
    b.finish().unwrap()
}
