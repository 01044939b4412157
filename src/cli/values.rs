//! Values as they are typed: sizes, rectangles, counts, spans of time.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

/// Most pixels of an image on one side.
const MAX_SIDE: u32 = 65_536;

/// Most pixels of an image.
const MAX_PIXELS: u64 = 1 << 28;

/// Width and height in pixels, typed `640x480`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let (w, h) = s
            .split_once(['x', 'X'])
            .ok_or("type width x height, for instance 640x480")?;
        let side = |t: &str| -> Result<u32, String> {
            t.parse()
                .map_err(|_| "type two whole numbers, for instance 640x480".into())
        };
        let (width, height) = (side(w)?, side(h)?);
        if width == 0 || height == 0 {
            return Err("width and height must be at least 1, for instance 640x480".into());
        }
        if width.max(height) > MAX_SIDE || u64::from(width) * u64::from(height) > MAX_PIXELS {
            return Err(format!(
                "at most {MAX_SIDE} pixels on a side and {} million in all; choose a smaller size",
                MAX_PIXELS >> 20
            ));
        }
        Ok(Self { width, height })
    }
}

/// A rectangle of pixels, typed `X0,Y0,X1,Y1`: left, top, right, bottom, the last two exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop(pub [u32; 4]);

impl FromStr for Crop {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let numbers: Result<Vec<u32>, _> = s.split(',').map(|t| t.trim().parse()).collect();
        match numbers.ok().and_then(|v| <[u32; 4]>::try_from(v).ok()) {
            None => Err("type left,top,right,bottom in pixels, for instance 0,0,64,64".into()),
            Some([x0, y0, x1, y1]) if x0 >= x1 || y0 >= y1 => Err(
                "right must exceed left and bottom must exceed top, for instance 0,0,64,64".into(),
            ),
            Some(c) => Ok(Self(c)),
        }
    }
}

/// Where light from all around comes from: a file, or a colour typed `R,G,B`.
#[derive(Clone, Debug, PartialEq)]
pub enum Sky {
    /// An image.
    Image(PathBuf),
    /// Radiance in W/(m²·sr).
    Color([f64; 3]),
}

impl FromStr for Sky {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let numbers: Option<Vec<f64>> = s.split(',').map(|t| t.trim().parse().ok()).collect();
        match numbers.map(<[f64; 3]>::try_from) {
            None => Ok(Self::Image(s.into())),
            Some(Ok(c)) if c.iter().all(|x| (0.0..=1e30).contains(x)) => Ok(Self::Color(c)),
            Some(_) => Err("type three numbers from 0, for instance 1,1,1, or a file".into()),
        }
    }
}

/// A factor from 0.
///
/// # Errors
/// What to type.
pub fn factor(s: &str) -> Result<f64, String> {
    s.parse()
        .ok()
        .filter(|x| (0.0..=1e30).contains(x))
        .ok_or_else(|| "type a number from 0, for instance 1.5".into())
}

/// A share: `5%`, or the number alone, in percent.
///
/// # Errors
/// What to type.
pub fn percent(s: &str) -> Result<f64, String> {
    factor(s.strip_suffix('%').unwrap_or(s))
        .map(|x| x / 100.0)
        .map_err(|_| "type a percentage from 0, for instance 5%".into())
}

/// A relative squared error to be reached.
///
/// # Errors
/// What to type.
pub fn error(s: &str) -> Result<f64, String> {
    s.parse()
        .ok()
        .filter(|x| (1e-12..=1e6).contains(x))
        .ok_or_else(|| "type an error above 0, for instance 0.001".into())
}

/// A moment, in seconds or frames.
///
/// # Errors
/// What to type.
pub fn moment(s: &str) -> Result<f64, String> {
    s.parse()
        .ok()
        .filter(|x: &f64| x.abs() <= 1e9)
        .ok_or_else(|| "type a number, for instance 1.5".into())
}

/// Frames in a second.
///
/// # Errors
/// What to type.
pub fn rate(s: &str) -> Result<f64, String> {
    s.parse()
        .ok()
        .filter(|x| (1e-3..=1e6).contains(x))
        .ok_or_else(|| "type a number of frames, for instance 24".into())
}

/// `on` or `off`.
///
/// # Errors
/// What to type.
pub fn on_off(s: &str) -> Result<bool, String> {
    match s {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("type on or off".into()),
    }
}

/// A whole number, with a suffix if one likes: `10k`, `1.5M`, `2G`.
///
/// # Errors
/// What is wrong, and what to type.
pub fn count(s: &str) -> Result<u64, String> {
    let hint = || "type a whole number, for instance 500, 10k or 1.5M".to_string();
    let digits = s.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor = match &s[digits.len()..] {
        "" => 1,
        "k" | "K" => 1_000,
        "m" | "M" => 1_000_000,
        "g" | "G" => 1_000_000_000_u64,
        _ => return Err(hint()),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let all_digits = |t: &str| t.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || !all_digits(whole) || !all_digits(fraction) {
        return Err(hint());
    }
    // Exactly, in integers: what the fraction adds must be whole too.
    let mut value = (whole.parse::<u64>().ok())
        .and_then(|w| w.checked_mul(factor))
        .ok_or_else(|| "is too large; type a smaller number".to_string())?;
    let mut unit = factor;
    for digit in fraction.trim_end_matches('0').bytes() {
        if unit % 10 != 0 {
            return Err(hint());
        }
        unit /= 10;
        value = value
            .checked_add(u64::from(digit - b'0') * unit)
            .ok_or("is too large; type a smaller number")?;
    }
    Ok(value)
}

/// A [`count`] of at least 1.
///
/// # Errors
/// As [`count`].
pub fn positive(s: &str) -> Result<u64, String> {
    match count(s)? {
        0 => Err("must be at least 1".into()),
        n => Ok(n),
    }
}

/// A [`positive`] count that fits 32 bits.
///
/// # Errors
/// As [`count`].
pub fn positive_u32(s: &str) -> Result<u32, String> {
    u32::try_from(positive(s)?).map_err(|_| "is too large; type a smaller number".into())
}

/// A number of photons: as [`positive`], with a hint what to do instead of none.
///
/// # Errors
/// As [`count`].
pub fn photons(s: &str) -> Result<u64, String> {
    match count(s)? {
        0 => Err(
            "must be at least 1; to go without photons choose --integrator path, without \
             caustics --effects=-caustics"
                .into(),
        ),
        n => Ok(n),
    }
}

/// Final-gather rays: a count, or `off`.
///
/// # Errors
/// As [`count`].
pub fn gather(s: &str) -> Result<u32, String> {
    match s {
        "off" => Ok(0),
        "0" => Err("must be at least 1, or off".into()),
        _ => positive_u32(s).map_err(|e| format!("{e}, or off")),
    }
}

/// Stops of exposure.
///
/// # Errors
/// What is wrong, and what to type.
pub fn stops(s: &str) -> Result<f64, String> {
    match s.parse::<f64>() {
        Ok(v) if v.abs() <= 128.0 => Ok(v),
        _ => Err("type a number of stops between -128 and 128, for instance -1.5".into()),
    }
}

/// A span of time: `30s`, `5m`, `1h`, `1h30m`, `0.5s`; a bare number is seconds.
///
/// # Errors
/// What is wrong, and what to type.
pub fn duration(s: &str) -> Result<Duration, String> {
    let hint = || "type a span of time, for instance 30s, 5m or 1h30m".to_string();
    let mut seconds = 0.0;
    let mut rest = s.trim();
    if rest.is_empty() {
        return Err(hint());
    }
    while !rest.is_empty() {
        let end = rest
            .find(|c: char| !(c.is_ascii_digit() || c == '.'))
            .unwrap_or(rest.len());
        let number: f64 = rest[..end].parse().map_err(|_| hint())?;
        let unit_end = rest[end..]
            .find(|c: char| !c.is_ascii_alphabetic())
            .map_or(rest.len(), |n| end + n);
        seconds += number
            * match &rest[end..unit_end] {
                "s" => 1.0,
                "m" | "min" => 60.0,
                "h" => 3600.0,
                // A bare number must be all there is.
                "" if rest.len() == s.trim().len() && unit_end == rest.len() => 1.0,
                _ => return Err(hint()),
            };
        rest = &rest[unit_end..];
    }
    if !(seconds > 0.0) {
        return Err("must be longer than nothing, for instance 30s".into());
    }
    // A thousand years are as good as no limit, and no sum with them overflows.
    Ok(Duration::from_secs_f64(f64::min(seconds, 3.2e10)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        let size = |s: &str| s.parse::<Size>().map(|s| (s.width, s.height));
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert_eq!(size("1X65536"), Ok((1, 65536)));
        for bad in [
            "0x0",
            "640",
            "640x",
            "x480",
            "-1x5",
            "6.5x3",
            "1x2x3",
            "65537x1",
            "60000x60000",
            "99999999999x1",
            "",
            "640 x 480",
            "١x1",
        ] {
            let e = size(bad).unwrap_err();
            assert!(e.contains("640x480") || e.contains("smaller"), "{bad}: {e}");
        }
    }

    #[test]
    fn crops() {
        assert_eq!("0,1,2,3".parse(), Ok(Crop([0, 1, 2, 3])));
        assert_eq!("0, 1, 2, 3".parse(), Ok(Crop([0, 1, 2, 3])));
        for bad in [
            "",
            "1,2,3",
            "1,2,3,4,5",
            "2,0,2,5",
            "0,5,3,4",
            "-1,0,2,2",
            "a,b,c,d",
        ] {
            assert!(bad.parse::<Crop>().is_err(), "{bad}");
        }
    }

    #[test]
    fn counts() {
        for (s, n) in [
            ("0", 0),
            ("16", 16),
            ("10k", 10_000),
            ("2M", 2_000_000),
            ("1.5M", 1_500_000),
            ("0.25k", 250),
            ("3G", 3_000_000_000),
            ("1.0", 1),
            ("18446744073709551615", u64::MAX),
        ] {
            assert_eq!(count(s), Ok(n), "{s}");
        }
        for bad in [
            "",
            "k",
            "-1",
            "1e3",
            "1.2345k",
            "1.50",
            "10kk",
            "10q",
            "1 k",
            "inf",
            ".5k",
            "1..2k",
            "é",
            "18446744073709551616",
            "99999999999999999G",
        ] {
            assert!(count(bad).is_err(), "{bad}");
        }
        assert!(positive("0").is_err() && positive_u32("5G").is_err());
        assert_eq!((gather("off"), gather("8")), (Ok(0), Ok(8)));
        assert!(gather("0").is_err() && gather("on").unwrap_err().contains("off"));
        assert!(photons("0").unwrap_err().contains("--integrator path"));
    }

    #[test]
    fn spans_of_time() {
        for (s, seconds) in [
            ("30s", 30.0),
            ("5m", 300.0),
            ("1h", 3600.0),
            ("1h30m", 5400.0),
            ("0.5s", 0.5),
            ("90", 90.0),
        ] {
            assert_eq!(duration(s), Ok(Duration::from_secs_f64(seconds)), "{s}");
        }
        for bad in [
            "", "0", "0s", "5x", "m", "1h30", "-3s", "1.2.3s", "nan", "inf", "5m é",
        ] {
            assert!(duration(bad).is_err(), "{bad}");
        }
        assert!(duration("99999999999999999999999h").is_ok());
    }

    #[test]
    fn exposures() {
        assert_eq!(stops("-1.5"), Ok(-1.5));
        for bad in ["nan", "inf", "1000", "bright", ""] {
            assert!(stops(bad).is_err(), "{bad}");
        }
    }
}
