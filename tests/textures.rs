//! Lookups of images against closed forms: blends, wrapping, transforms, averages over areas.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::sync::Arc;

use dualight::color::srgb_to_linear;
use dualight::textures::{Content, Filter, Image, Sampler, Texels, Texture, UvTransform, Wrap};
use proptest::prelude::*;

const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];

/// A grey image of bytes.
fn grey(width: u32, height: u32, f: impl Fn(u32, u32) -> u8) -> Arc<Image> {
    let bytes = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| f(x, y))
        .collect();
    Arc::new(Image::from_texels(width, height, 1, Texels::U8(bytes)).unwrap())
}

fn data(image: Arc<Image>) -> Texture {
    Texture::new(image, Content::Data)
}

/// Some bytes without pattern.
fn noise(x: u32, y: u32) -> u8 {
    let h = (x.wrapping_mul(0x9E37_79B9) ^ y.wrapping_mul(0x85EB_CA6B)).wrapping_mul(0xC2B2_AE35);
    (h >> 24) as u8
}

/// Squares of 8 × 8 texels.
fn checker(n: u32) -> Arc<Image> {
    grey(n, n, |x, y| if (x / 8 + y / 8) % 2 == 0 { 255 } else { 0 })
}

/// What lies at texel `i` of `n`, written independently of the code under test.
fn wrapped(wrap: Wrap, i: i64, n: i64) -> i64 {
    match wrap {
        Wrap::Repeat => ((i % n) + n) % n,
        Wrap::Clamp => i.max(0).min(n - 1),
        Wrap::Mirror => {
            let mut i = i;
            loop {
                if i < 0 {
                    i = -1 - i;
                } else if i >= n {
                    i = 2 * n - 1 - i;
                } else {
                    return i;
                }
            }
        }
    }
}

#[test]
fn blends_and_wrapping_meet_their_definition() {
    let (w, h) = (5_u32, 3_u32);
    let image = grey(w, h, noise);
    for wrap_u in WRAPS {
        for wrap_v in WRAPS {
            for filter in [Filter::Nearest, Filter::Linear] {
                let t = Texture {
                    sampler: Sampler {
                        wrap_u,
                        wrap_v,
                        filter,
                    },
                    ..data(Arc::clone(&image))
                };
                let texel = |x: i64, y: i64| {
                    let x = wrapped(wrap_u, x, i64::from(w)) as u32;
                    let y = wrapped(wrap_v, y, i64::from(h)) as u32;
                    f64::from(noise(x, y)) / 255.0
                };
                for i in -37..60 {
                    let (u, v) = (f64::from(i) * 0.0713, f64::from(i) * -0.0391 + 0.2);
                    let (x, y) = (u * f64::from(w), v * f64::from(h));
                    let expected = if filter == Filter::Nearest {
                        texel(x.floor() as i64, y.floor() as i64)
                    } else {
                        let (x, y) = (x - 0.5, y - 0.5);
                        let (fx, fy) = (x - x.floor(), y - y.floor());
                        let (x, y) = (x.floor() as i64, y.floor() as i64);
                        (texel(x, y) * (1.0 - fx) + texel(x + 1, y) * fx) * (1.0 - fy)
                            + (texel(x, y + 1) * (1.0 - fx) + texel(x + 1, y + 1) * fx) * fy
                    };
                    let got = t.lookup([u, v], None)[0];
                    let error = (got - expected).abs();
                    assert!(error < 1e-6, "{wrap_u:?} {wrap_v:?} {filter:?} {u} {v}");
                }
            }
        }
    }
}

#[test]
fn colours_are_decoded_before_they_are_blended() {
    let image = grey(2, 1, |x, _| if x == 0 { 64 } else { 200 });
    let mut t = Texture::new(image, Content::Color);
    t.sampler.wrap_u = Wrap::Clamp;
    let (a, b) = (srgb_to_linear(64.0 / 255.0), srgb_to_linear(200.0 / 255.0));
    assert!((t.lookup([0.25, 0.5], None)[0] - a).abs() < 1e-7);
    assert!((t.lookup([0.5, 0.5], None)[1] - 0.5 * (a + b)).abs() < 1e-7);
    assert!((t.mean()[2] - 0.5 * (a + b)).abs() < 1e-7);
    let [low, high] = t.range();
    assert!((low[0] - a).abs() < 1e-7 && (high[0] - b).abs() < 1e-7);
    assert_eq!((low[3], high[3]), (1.0, 1.0));
}

/// The matrix of the sample code of `KHR_texture_transform`, with the sense of rotation that its
/// text and example state: counter-clockwise with `v` down.
#[test]
fn transforms_follow_the_extension() {
    let (r, [sx, sy], [ox, oy]) = (0.7_f64, [2.0, 3.0], [0.1, -0.4]);
    let t = UvTransform::new([ox, oy], r, [sx, sy]);
    let [u, v] = [0.3, 0.9];
    let (x, y) = (sx * u, sy * v);
    let expected = [
        r.cos() * x + r.sin() * y + ox,
        -r.sin() * x + r.cos() * y + oy,
    ];
    let got = t.apply([u, v]);
    assert!((got[0] - expected[0]).abs() < 1e-12 && (got[1] - expected[1]).abs() < 1e-12);
    let moved = t.apply([u + 0.01, v - 0.02]);
    let step = t.apply_difference([0.01, -0.02]);
    assert!((moved[0] - got[0] - step[0]).abs() < 1e-12);
    // A footprint goes through the transform too: twice as large, a level higher.
    let image = grey(64, 64, noise);
    let plain = data(Arc::clone(&image));
    let scaled = Texture {
        transform: Some(UvTransform::new([0.25, 0.5], 0.0, [2.0, 2.0])),
        ..data(image)
    };
    let a = plain.lookup([0.7, 0.2], Some([[0.1, 0.02], [0.0, 0.08]]));
    let b = scaled.lookup([0.225, -0.15], Some([[0.05, 0.01], [0.0, 0.04]]));
    assert!((a[0] - b[0]).abs() < 1e-9, "{a:?} {b:?}");
}

/// Huge footprints see the mean, of any image, also one whose sides are no powers of two.
#[test]
fn averages_keep_the_mean() {
    for (w, h) in [
        (1, 1),
        (2, 2),
        (64, 64),
        (37, 1),
        (1, 50),
        (45, 31),
        (100, 63),
        (3, 200),
    ] {
        let image = grey(w, h, noise);
        for content in [Content::Color, Content::Data, Content::Coverage] {
            let t = Texture::new(Arc::clone(&image), content);
            let mean = t.mean();
            let far = t.lookup([0.3, 0.6], Some([[40.0, 3.0], [1.0, 90.0]]));
            for k in 0..4 {
                assert!((far[k] - mean[k]).abs() < 2e-4, "{w}×{h} {content:?}");
            }
        }
    }
}

/// A mean of lookups all over the image is the image's mean, at every size of the footprint and
/// in every shape: nothing is lost or made on any level.
#[test]
fn filtered_lookups_keep_the_mean_over_the_image() {
    let image = grey(48, 20, noise);
    let t = Texture::new(image, Content::Color);
    let mean = t.mean()[0];
    for [x, y] in [
        [[0.03, 0.0], [0.0, 0.06]],
        [[0.2, 0.1], [0.01, 0.03]],
        [[0.01, 0.4], [0.02, 0.0]],
        [[0.3, 0.3], [-0.3, 0.3]],
    ] {
        let (n, m) = (96 * 2, 40 * 2);
        let mut sum = 0.0;
        for j in 0..m {
            for i in 0..n {
                let uv = [
                    (f64::from(i) + 0.5) / f64::from(n),
                    (f64::from(j) + 0.5) / f64::from(m),
                ];
                sum += t.lookup(uv, Some([x, y]))[0] / f64::from(n * m);
            }
        }
        assert!((sum / mean - 1.0).abs() < 2e-3, "{x:?} {y:?}: {sum} {mean}");
    }
}

/// Against brute force: the footprint's ellipse filled with point lookups under the same kernel.
#[test]
fn elliptical_averages_agree_with_many_points() {
    // Smooth content, so that what the kernel of a level adds does not count.
    let n = 256;
    let image = grey(n, n, |x, y| {
        let (x, y) = (f64::from(x) / f64::from(n), f64::from(y) / f64::from(n));
        let tau = std::f64::consts::TAU;
        (127.5 + 60.0 * (tau * 3.0 * x).sin() + 60.0 * (tau * (2.0 * y + x)).cos()) as u8
    });
    let t = data(image);
    for (uv, [x, y]) in [
        ([0.3, 0.4], [[0.1, 0.0], [0.0, 0.1]]),
        ([0.9, 0.05], [[0.2, 0.1], [-0.02, 0.04]]),
        ([0.6, 0.6], [[0.0, 0.3], [0.05, 0.1]]),
        ([0.1, 0.8], [[0.05, 0.05], [-0.05, 0.05]]),
    ] {
        let (mut sum, mut weight) = (0.0, 0.0);
        let n = 200;
        for i in -n..=n {
            for j in -n..=n {
                let (p, q) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                let w = (1.0 - p * p - q * q).max(0.0).powi(2);
                if w > 0.0 {
                    let at = [uv[0] + p * x[0] + q * y[0], uv[1] + p * x[1] + q * y[1]];
                    sum += w * t.lookup(at, None)[0];
                    weight += w;
                }
            }
        }
        let got = t.lookup(uv, Some([x, y]))[0];
        assert!(
            (got - sum / weight).abs() < 0.02,
            "{uv:?}: {got} {}",
            sum / weight
        );
    }
}

/// A chequered plane toward the horizon: with footprints, one lookup per pixel is what many
/// points per pixel converge to.
#[test]
fn a_plane_to_the_horizon_does_not_alias() {
    let mut t = data(checker(64));
    let (width, height) = (64, 48);
    // A camera one unit above the plane, looking level; the ray through (x, y) meets the plane
    // at depth 1/y. One unit holds four images, 256 texels.
    let at = |x: f64, y: f64| {
        let s = y / f64::from(height);
        let depth = 1.0 / s;
        [4.0 * (x / f64::from(width) - 0.5) * depth, 4.0 * depth]
    };
    for filter in [Filter::Linear, Filter::Nearest] {
        t.sampler.filter = filter;
        let (mut worst, mut aliased, mut count) = (0.0_f64, 0.0, 0.0);
        for j in 0..height {
            for i in 0..width {
                let (x, y) = (f64::from(i) + 0.5, f64::from(j) + 0.5);
                let d = 1e-4;
                let slope = |dx: f64, dy: f64| {
                    let (a, b) = (at(x - dx, y - dy), at(x + dx, y + dy));
                    [(b[0] - a[0]) / (2.0 * d), (b[1] - a[1]) / (2.0 * d)]
                };
                let footprint = [slope(d, 0.0), slope(0.0, d)];
                let got = t.lookup(at(x, y), Some(footprint))[0];
                // The same kernel by 40 × 40 points.
                let (mut sum, mut weight) = (0.0, 0.0);
                for k in 0..40 {
                    for l in 0..40 {
                        let p = (f64::from(k) + 0.5) / 20.0 - 1.0;
                        let q = (f64::from(l) + 0.5) / 20.0 - 1.0;
                        let w = (1.0 - p * p - q * q).max(0.0).powi(2);
                        let q = q.max(-0.9 * y);
                        sum += w * t.lookup(at(x + p, y + q), None)[0];
                        weight += w;
                    }
                }
                let reference = sum / weight;
                let point = t.lookup(at(x, y), None)[0];
                worst = worst.max((got - reference).abs());
                aliased += (point - reference).powi(2);
                count += (got - reference).powi(2);
            }
        }
        let n = f64::from(width * height);
        let (filtered, aliased) = ((count / n).sqrt(), (aliased / n).sqrt());
        println!("{filter:?}: filtered {filtered:.4} (worst {worst:.3}), points {aliased:.4}");
        assert!(filtered < 0.02 && worst < 0.1 && filtered < 0.05 * aliased);
    }
}

/// Where alpha says how much colour there is, invisible colour does not bleed into the rest.
#[test]
fn invisible_colour_does_not_bleed() {
    let texels = (0..64 * 64)
        .flat_map(|i| {
            if (i / 3) % 2 == 0 {
                [255, 0, 0, 255]
            } else {
                [0, 255, 0, 0]
            }
        })
        .collect();
    let image = Arc::new(Image::from_texels(64, 64, 4, Texels::U8(texels)).unwrap());
    for footprint in [
        None,
        Some([[0.1, 0.0], [0.0, 0.1]]),
        Some([[9.0, 0.0], [0.0, 9.0]]),
    ] {
        for i in 0..100 {
            let uv = [0.013 * f64::from(i), 0.37 * f64::from(i)];
            let t = Texture::new(Arc::clone(&image), Content::Coverage).lookup(uv, footprint);
            if t[3] > 0.0 {
                assert!((t[0] - 1.0).abs() < 1e-3 && t[1] < 1e-3, "{t:?}");
            }
            let t = Texture::new(Arc::clone(&image), Content::Color).lookup(uv, footprint);
            assert!(
                footprint.is_none() || t[1] > 0.1,
                "colour alone is averaged: {t:?}"
            );
        }
    }
}

#[test]
fn averaged_normals_have_unit_length() {
    let texels = (0..32 * 32)
        .flat_map(|i| {
            if i % 2 == 0 {
                [255, 128, 128]
            } else {
                [128, 255, 128]
            }
        })
        .collect();
    let image = Arc::new(Image::from_texels(32, 32, 3, Texels::U8(texels)).unwrap());
    let t = Texture::new(image, Content::Normal);
    let [x, y, z, _] = t.lookup([0.4, 0.4], Some([[3.0, 0.0], [0.0, 3.0]]));
    let n = [x, y, z].map(|c| 2.0 * c - 1.0);
    let length = n.iter().map(|c| c * c).sum::<f64>().sqrt();
    assert!(
        (length - 1.0).abs() < 1e-3 && (n[0] - n[1]).abs() < 1e-3,
        "{n:?}"
    );
    assert!((n[0] - 0.5_f64.sqrt()).abs() < 0.01);
}

#[test]
fn sixteen_bits_and_floats_are_filtered_too() {
    let deep: Vec<u16> = (0..40 * 24).map(|i| (i * 7919 % 65536) as u16).collect();
    let t = data(Arc::new(
        Image::from_texels(40, 24, 1, Texels::U16(deep)).unwrap(),
    ));
    let far = t.lookup([0.5, 0.5], Some([[50.0, 0.0], [0.0, 50.0]]));
    assert!((far[0] - t.mean()[0]).abs() < 1e-4);
    let bright = (0..9).map(|i| [i as f32 * 1e4, -1.0, 0.5, 1.0]).collect();
    let t = Texture::new(Arc::new(Image::new(3, 3, bright).unwrap()), Content::Color);
    let far = t.lookup([0.5, 0.5], Some([[50.0, 0.0], [0.0, 50.0]]));
    assert!((far[0] - 4e4).abs() < 0.1 && (far[1] + 1.0).abs() < 1e-6);
    assert_eq!(t.range()[1][0], 8e4);
}

#[test]
fn images_need_texels_that_fit() {
    assert!(Image::from_texels(0, 1, 1, Texels::U8(vec![])).is_none());
    assert!(Image::from_texels(2, 1, 1, Texels::U8(vec![1])).is_none());
    assert!(Image::from_texels(1, 1, 5, Texels::U8(vec![1; 5])).is_none());
    assert!(Image::new(u32::MAX, u32::MAX, vec![]).is_none());
    let white = Image::white();
    assert_eq!(white.texel(0, 0, Content::Color), [1.0; 4]);
}

/// Sizes prepared on all threads are those made on demand.
#[test]
fn prepared_sizes_are_the_same() {
    let image = grey(77, 53, noise);
    let (a, b) = (data(Arc::clone(&image)), data(grey(77, 53, noise)));
    b.image.prepare(Content::Data);
    for i in 0..50 {
        let s = 0.02 * f64::from(i);
        let f = Some([[s, 0.1 * s], [-0.3 * s, 0.5 * s]]);
        assert_eq!(a.lookup([s, 1.0 - s], f), b.lookup([s, 1.0 - s], f));
    }
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>(),
        -3.0..3.0,
        -1e-3..1e-3,
        -1e9..1e9,
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(0.0),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// Any coordinates and any footprint give a value within the image's range.
    #[test]
    fn every_lookup_ends_within_the_range(
        (w, h) in (1_u32..40, 1_u32..40),
        uv in [any_number(), any_number()],
        x in [any_number(), any_number()],
        y in [any_number(), any_number()],
        wrap in (0_usize..3, 0_usize..3),
        nearest: bool,
        transform in proptest::option::of(([any_number(), any_number()], any_number())),
    ) {
        let mut t = data(grey(w, h, |x, y| noise(x, y) / 2 + 30));
        t.sampler = Sampler {
            wrap_u: WRAPS[wrap.0],
            wrap_v: WRAPS[wrap.1],
            filter: if nearest { Filter::Nearest } else { Filter::Linear },
        };
        t.transform = transform.map(|(o, r)| UvTransform::new(o, r, [1.5, -0.5]));
        let [low, high] = t.range();
        for footprint in [None, Some([x, y])] {
            let got = t.lookup(uv, footprint);
            prop_assert!(got[0] >= low[0] - 1e-4 && got[0] <= high[0] + 1e-4, "{:?}", got);
            prop_assert!((got[3] - 1.0).abs() < 1e-9);
        }
    }
}
