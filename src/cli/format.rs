//! Numbers as people read them.

use std::time::Duration;

/// A count with three digits and a suffix: `1.23M`.
pub(super) fn count(n: f64) -> String {
    for (factor, suffix) in [(1e9, "G"), (1e6, "M"), (1e3, "k")] {
        // What would be rounded up to the next suffix takes it.
        if n >= 0.9995 * factor {
            let v = n / factor;
            let digits = if v < 9.995 {
                2
            } else if v < 99.95 {
                1
            } else {
                0
            };
            return format!("{v:.digits$}{suffix}");
        }
    }
    format!("{n:.0}")
}

/// A number of bytes: `1.5 GiB`.
pub(super) fn bytes(n: u64) -> String {
    let n = n as f64;
    for (factor, suffix) in [(1_u64 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")] {
        if n >= factor as f64 {
            return format!("{:.1} {suffix}", n / factor as f64);
        }
    }
    format!("{n} B")
}

/// A span of time in the future: `8 s`, `2 min 5 s`, `3 h 20 min`.
pub(super) fn span(d: Duration) -> String {
    match d.as_secs() {
        s @ 0..60 => format!("{s} s"),
        s @ 60..3600 => format!("{} min {} s", s / 60, s % 60),
        s => format!("{} h {} min", s / 3600, s / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (n, s) in [
            (0.0, "0"),
            (999.0, "999"),
            (1000.0, "1.00k"),
            (12_345.0, "12.3k"),
            (999_600.0, "1.00M"),
            (123_456_789.0, "123M"),
            (5e12, "5000G"),
        ] {
            assert_eq!(count(n), s);
        }
        assert_eq!(bytes(1023), "1023 B");
        assert_eq!(bytes(3 << 29), "1.5 GiB");
        assert_eq!(span(Duration::from_secs(59)), "59 s");
        assert_eq!(span(Duration::from_secs(125)), "2 min 5 s");
        assert_eq!(span(Duration::from_secs(12_000)), "3 h 20 min");
    }
}
