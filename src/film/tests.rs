//! What films do with samples.

use super::*;

#[test]
fn tiles_add_up_to_means_and_components_to_the_beauty() {
    let mut film = Film::new(3, 2);
    let mut s = PixelSample {
        alpha: 2.0,
        ..Default::default()
    };
    s.add(Component::Direct, Rgb::new(2.0, 4.0, 6.0));
    s.add(Component::Caustics, Rgb::splat(2.0));
    film.add(&Tile {
        x: 1,
        y: 1,
        width: 2,
        height: 1,
        sums: vec![s, s],
        samples: 2,
    });
    assert_eq!(film.sample_range(), (0, 2));
    let image = film.develop();
    assert_eq!(
        image.rgb(""),
        Some(
            [
                [0.0; 3],
                [0.0; 3],
                [0.0; 3],
                [0.0; 3],
                [2.0, 3.0, 4.0],
                [2.0, 3.0, 4.0]
            ]
            .to_vec()
        )
    );
    assert_eq!(image.rgb("caustics").map(|v| v[4]), Some([1.0; 3]));
}

fn tile_of(x: u32, y: u32, radiance: f64) -> Tile {
    let mut s = PixelSample::default();
    s.add(Component::Direct, Rgb::splat(radiance));
    Tile {
        x,
        y,
        width: 1,
        height: 1,
        sums: vec![s],
        samples: 1,
    }
}

#[test]
fn a_sum_that_is_not_finite_is_left_out_and_counted() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e39] {
        let mut film = Film::new(1, 1);
        film.add(&tile_of(0, 0, bad));
        assert_eq!((film.rejected(), film.sample_range()), (1, (0, 0)), "{bad}");
        assert_eq!(film.first_rejected(), Some([0, 0]));
    }
}

#[test]
fn a_pixel_whose_sum_would_overflow_keeps_what_it_has() {
    let mut film = Film::new(1, 1);
    film.add(&tile_of(0, 0, 3e38));
    film.add(&tile_of(0, 0, 3e38));
    assert_eq!((film.rejected(), film.sample_range()), (1, (1, 1)));
    let red = film.develop().rgb("direct").map(|v| v[0][0]);
    assert_eq!(red, Some(3e38));
}

#[test]
fn data_beyond_single_precision_does_not_cost_the_pixel() {
    let mut film = Film::new(1, 1);
    let mut tile = tile_of(0, 0, 1.0);
    tile.sums[0].position = DVec3::new(-1e300, 3e38, 1.0);
    tile.sums[0].photons = [1e40, 0.0];
    film.add(&tile);
    film.add(&tile);
    assert_eq!((film.rejected(), film.sample_range()), (0, (2, 2)));
    let image = film.develop();
    assert_eq!(image.rgb("direct"), Some(vec![[1.0; 3]]));
    let all = image.layers.iter().flat_map(|l| &l.channels);
    assert!(all.flat_map(|c| &c.data).all(|v| v.is_finite()));
    // What is no number in the first place is still left out.
    tile.sums[0].photons = [f64::INFINITY, 0.0];
    film.add(&tile);
    assert_eq!((film.rejected(), film.sample_range()), (1, (2, 2)));
}

#[test]
fn the_first_pixel_left_out_does_not_depend_on_the_order_of_tiles() {
    let mut film = Film::new(3, 2);
    for [x, y] in [[0, 1], [2, 0], [1, 1]] {
        film.add(&tile_of(x, y, f64::NAN));
    }
    assert_eq!((film.rejected(), film.first_rejected()), (3, Some([2, 0])));
}
