//! The perceptual difference FLIP (Andersson et al. 2020) of two images as a display shows them.

use super::diff::Pair;
use crate::output::display_bytes;

/// FLIP of each pixel, at the authors' viewing distance of 67 pixels per degree.
pub(super) fn map(pair: &Pair, exposure: f64) -> Vec<f32> {
    let shown = |pixels: &[[f32; 3]]| {
        nv_flip::FlipImageRgb8::with_data(pair.width, pair.height, &display_bytes(pixels, exposure))
    };
    nv_flip::flip(
        shown(&pair.reference),
        shown(&pair.image),
        nv_flip::DEFAULT_PIXELS_PER_DEGREE,
    )
    .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(image: [f32; 3], reference: [f32; 3]) -> Pair {
        Pair {
            layer: String::new(),
            width: 40,
            height: 30,
            image: vec![image; 1200],
            reference: vec![reference; 1200],
        }
    }

    #[test]
    fn equal_images_have_none_and_opposite_ones_nearly_all() {
        let mean = |p: &Pair| p.compare(0.0).flip.unwrap();
        assert_eq!(mean(&pair([0.3; 3], [0.3; 3])), 0.0);
        let far = mean(&pair([1.0; 3], [0.0; 3]));
        assert!((0.9..=1.0).contains(&far), "{far}");
        let near = mean(&pair([0.5; 3], [0.52; 3]));
        assert!((0.001..0.1).contains(&near), "{near}");
    }

    #[test]
    fn one_pixel_is_an_image() {
        let p = Pair {
            width: 1,
            height: 1,
            image: vec![[1.0; 3]],
            reference: vec![[0.0; 3]],
            ..pair([0.0; 3], [0.0; 3])
        };
        assert_eq!(map(&p, 0.0).len(), 1);
    }
}
