//! Who wrote a file, where that changes what it means. Blender's exporter writes less than Cycles
//! shows, and some of it in other units than glTF's: all that is read otherwise for its files is
//! decided here.

use super::json::Cursor;
use super::material;
use crate::color::units::LightUnits;
use crate::lights::SpotCurve;
use crate::materials::{Brushing, MaterialDesc};

/// Who wrote a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dialect {
    /// Nobody who is known: the specification holds.
    Plain,
    /// Blender's own exporter, of this version as far as the file tells.
    Blender(Option<[u32; 2]>),
}

/// How Blender's exporter signs: so since 0.9, and before.
const SIGNATURES: [&str; 2] = ["Khronos glTF Blender I/O", "Khronos Blender glTF 2.0"];

/// The first version that writes candela and lux; those before write watts as they are.
const PHOTOMETRIC: [u32; 2] = [3, 4];

impl Dialect {
    /// That of the document `root`.
    pub(super) fn of(root: &Cursor<'_>) -> Self {
        let generator = root.get("asset").and_then(|a| a.get("generator"));
        let Some(text) = generator.as_ref().and_then(|g| g.str().ok()) else {
            return Self::Plain;
        };
        let rest = |mark: &&str| text.split_once(*mark).map(|(_, rest)| rest);
        SIGNATURES
            .iter()
            .find_map(rest)
            .map_or(Self::Plain, |rest| Self::Blender(version(rest)))
    }

    pub(super) fn is_blender(self) -> bool {
        self != Self::Plain
    }

    /// The units of its lamps, unless the user says otherwise, and why; `None` where the file's
    /// writer does not decide.
    pub(super) fn lamps(self) -> Option<(LightUnits, String)> {
        let Self::Blender(version) = self else {
            return None;
        };
        let [major, minor] = PHOTOMETRIC;
        let old = version.is_none_or(|v| v < PHOTOMETRIC);
        let who = match version {
            Some([a, b]) => format!("version {a}.{b} of Blender's exporter wrote the file"),
            None => "an early version of Blender's exporter wrote the file".to_owned(),
        };
        Some(if old {
            let why = format!(
                "lamps are taken as watts: {who}, and before {major}.{minor} it did not convert \
                 them; --light-units says otherwise"
            );
            (LightUnits::Watts, why)
        } else {
            let why = format!(
                "lamps are taken as Blender exports them, divided by 683: {who}, which does not \
                 tell its lighting mode; if that was Unitless, --light-units radiometric is right, \
                 if it was Raw, --light-units watts"
            );
            (LightUnits::Blender, why)
        })
    }

    /// Whose lamps the file's are, if the user says of which units they are: those of Blender are
    /// Blender's lamps, also where another program signed the file since.
    pub(super) fn of_lamps(self, asked: LightUnits) -> Self {
        match asked {
            LightUnits::Blender if !self.is_blender() => Self::Blender(None),
            _ => self,
        }
    }

    /// How spots fall off.
    pub(super) fn spot_curve(self) -> SpotCurve {
        if self.is_blender() {
            SpotCurve::Cycles
        } else {
            SpotCurve::Gltf
        }
    }

    /// Whether lamps end at their range. In Blender the custom distance is for its rasteriser alone;
    /// Cycles takes no heed of it.
    pub(super) fn has_ranges(self) -> bool {
        !self.is_blender()
    }

    /// Reads of a material's description what Cycles would.
    pub(super) fn apply(self, desc: &mut MaterialDesc) {
        if self.is_blender() {
            // Backface culling, which this says of Blender's materials, is for its rasteriser alone:
            // in Cycles surfaces emit from both sides.
            desc.double_sided = true;
            // The exporter writes the number of the Principled BSDF as it is.
            desc.brushing = Brushing::Cycles;
        }
    }
}

/// The numbers of a version that text begins with, as in ` v3.6.27`.
fn version(text: &str) -> Option<[u32; 2]> {
    let text = text.trim_start().strip_prefix('v')?;
    let mut parts = text.split(|c: char| !c.is_ascii_digit());
    let major = parts.next()?.parse().ok()?;
    let minor = parts.next()?.parse().ok()?;
    Some([major, minor])
}

/// Whether some material of the document `root` emits, by its factor.
pub(super) fn emits(root: &Cursor<'_>) -> bool {
    let materials = root.items("materials").unwrap_or_default();
    materials.iter().any(|m| material::emits(m))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn writers_are_known_by_their_signatures() {
        let of = |generator: &str| {
            let json = json!({"asset": {"generator": generator}});
            Dialect::of(&Cursor::root(&json))
        };
        for (generator, version) in [
            ("Khronos glTF Blender I/O v5.0.21", Some([5, 0])),
            (
                "Khronos glTF Blender I/O v3.6.27 with hand-edits",
                Some([3, 6]),
            ),
            ("Khronos glTF Blender I/O v1.6.16", Some([1, 6])),
            ("Khronos glTF Blender I/O v0.9.47", Some([0, 9])),
            ("Khronos glTF Blender I/O", None),
            ("Khronos glTF Blender I/O v", None),
            ("Khronos glTF Blender I/O v99999999999.1", None),
            ("Khronos Blender glTF 2.0 I/O", None),
            ("Khronos Blender glTF 2.0 exporter, plus hand-edits", None),
        ] {
            assert_eq!(of(generator), Dialect::Blender(version), "{generator}");
        }
        for generator in [
            "",
            "gltfpack 0.16",
            "glTF-Transform v3.0.4, and Blender 3.3",
        ] {
            assert_eq!(of(generator), Dialect::Plain, "{generator}");
        }
        assert_eq!(Dialect::of(&Cursor::root(&json!({}))), Dialect::Plain);
    }

    #[test]
    fn brushed_metal_from_blender_is_as_wide_as_in_cycles() {
        let brushed = MaterialDesc {
            anisotropy: 0.8,
            ..Default::default()
        };
        for (dialect, [along, across]) in [
            // mix(α, 1, s²) and α; α/√(1 − 0.9 s) and α·√(1 − 0.9 s).
            (Dialect::Plain, [0.09 + 0.91 * 0.64, 0.09]),
            (
                Dialect::Blender(None),
                [0.09 / 0.28f64.sqrt(), 0.09 * 0.28f64.sqrt()],
            ),
        ] {
            let mut desc = brushed.clone();
            dialect.apply(&mut desc);
            let [x, y] = desc.brushing.widths(0.3f64 * 0.3, desc.anisotropy);
            assert!(
                (x - along).abs() < 1e-12 && (y - across).abs() < 1e-12,
                "{dialect:?}"
            );
        }
        // As in Cycles no width exceeds 1; without strength nothing is brushed.
        assert_eq!(Brushing::Cycles.widths(0.9, 1.0)[0], 1.0);
        assert_eq!(Brushing::Cycles.widths(0.25, 0.0), [0.25; 2]);
    }

    #[test]
    fn lamps_are_watts_before_version_3_4() {
        let units = |v| Dialect::Blender(v).lamps().map(|(units, _)| units);
        for v in [None, Some([0, 9]), Some([1, 8]), Some([3, 3])] {
            assert_eq!(units(v), Some(LightUnits::Watts), "{v:?}");
        }
        for v in [Some([3, 4]), Some([3, 10]), Some([4, 0]), Some([10, 1])] {
            assert_eq!(units(v), Some(LightUnits::Blender), "{v:?}");
        }
        assert_eq!(Dialect::Plain.lamps(), None);
    }
}
