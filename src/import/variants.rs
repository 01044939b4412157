//! Variants of the materials (`KHR_materials_variants`).

use super::Problem;
use super::json::Cursor;

/// The variants of a file, by name.
fn list<'a>(root: &Cursor<'a>) -> Result<Vec<Cursor<'a>>, Problem> {
    match root.extension("KHR_materials_variants") {
        Some(e) => e.items("variants"),
        None => Ok(Vec::new()),
    }
}

/// The index of the variant that is asked for.
pub(super) fn choose(root: &Cursor<'_>, name: Option<&str>) -> Result<Option<usize>, Problem> {
    let Some(name) = name else {
        return Ok(None);
    };
    let variants = list(root)?;
    match variants.iter().position(|v| v.name() == name) {
        Some(index) => Ok(Some(index)),
        None => {
            let known: Vec<String> = variants.iter().map(Cursor::name).collect();
            Err(Problem {
                remedy: if known.is_empty() {
                    "leave --variant out".into()
                } else {
                    format!("known variants: {}", known.join(", "))
                },
                ..Problem::invalid(
                    "/extensions/KHR_materials_variants",
                    format!("no variant is named '{name}'"),
                )
            })
        }
    }
}

/// Where the index of the material of primitive `p` stands, if it has one: that of the variant
/// where one is mapped to it, and else its own.
pub(super) fn material<'a>(
    p: &Cursor<'a>,
    variant: Option<usize>,
) -> Result<Option<Cursor<'a>>, Problem> {
    if let (Some(chosen), Some(e)) = (variant, p.extension("KHR_materials_variants")) {
        for mapping in e.items("mappings")? {
            for v in mapping.items("variants")? {
                if v.index()? == chosen {
                    return mapping.need("material").map(Some);
                }
            }
        }
    }
    Ok(p.get("material"))
}
