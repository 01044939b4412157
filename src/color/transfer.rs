//! The sRGB transfer curve (IEC 61966-2-1).

/// sRGB code value in `0..=1` of a linear value; values outside are clamped.
pub fn linear_to_srgb(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    }
}

/// Linear value of an sRGB code value in `0..=1`.
pub fn srgb_to_linear(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    if x <= 0.040_45 {
        x / 12.92
    } else {
        ((x + 0.055) / 1.055).powf(2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_inverse_and_meet_the_standard() {
        for i in 0..=1000 {
            let x = f64::from(i) / 1000.0;
            assert!((srgb_to_linear(linear_to_srgb(x)) - x).abs() < 1e-6);
        }
        assert!((linear_to_srgb(0.214_041_14) - 0.5).abs() < 1e-6);
    }
}
