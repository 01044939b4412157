//! The house rules that no compiler checks: layers look down, plugin tables list what their
//! folders hold, unsafe code stays in `ffi/`, files stay small. Reads the sources as text.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use dualight::plugins::Registry;

#[path = "../examples/custom_material.rs"]
#[allow(dead_code, unreachable_pub, reason = "its main function is not called")]
mod custom_material;

/// A floor of the house: rooms, and the floors below that they may use. A room may use itself.
struct Layer {
    name: &'static str,
    rooms: &'static [&'static str],
    uses: &'static [&'static str],
}

/// From the bottom up. A room is a file or folder of `src/`.
const LAYERS: &[Layer] = &[
    Layer {
        name: "L0",
        rooms: &[
            "math", "ad", "sampling", "color", "error", "registry", "control", "stats",
        ],
        uses: &["L0"],
    },
    Layer {
        name: "film",
        rooms: &["film"],
        uses: &["L0"],
    },
    Layer {
        name: "output",
        rooms: &["output"],
        uses: &["L0", "film"],
    },
    Layer {
        name: "L1",
        rooms: &["geometry"],
        uses: &["L0"],
    },
    Layer {
        name: "L2 textures",
        rooms: &["textures"],
        uses: &["L0", "L1"],
    },
    Layer {
        name: "L2",
        rooms: &["materials", "lights", "cameras"],
        uses: &["L0", "L1", "L2 textures"],
    },
    Layer {
        name: "ffi",
        rooms: &["ffi"],
        uses: &[],
    },
    Layer {
        name: "L2 accel",
        rooms: &["accel"],
        uses: &["L0", "L1", "ffi"],
    },
    Layer {
        name: "L3",
        rooms: &["scene"],
        uses: &["L0", "L1", "L2 textures", "L2", "L2 accel"],
    },
    Layer {
        name: "L4 import",
        rooms: &["import"],
        uses: &["L0", "L1", "L2 textures", "L2", "L3"],
    },
    Layer {
        name: "L5 effects",
        rooms: &["effects"],
        uses: &["L0", "L1", "L2", "L3"],
    },
    Layer {
        name: "L5 photons",
        rooms: &["photons"],
        uses: &["L0", "L1", "L2", "L3", "L2 accel", "L5 effects"],
    },
    Layer {
        name: "L5 integrators",
        rooms: &["integrators"],
        uses: &[
            "L0",
            "film",
            "L1",
            "L2",
            "L3",
            "L2 accel",
            "L5 effects",
            "L5 photons",
        ],
    },
    Layer {
        name: "L7",
        rooms: &["plugins", "pipeline", "report", "cli", "main", "lib"],
        uses: &[
            "L0",
            "film",
            "output",
            "L1",
            "L2 textures",
            "L2",
            "L3",
            "L4 import",
            "L2 accel",
            "L5 effects",
            "L5 photons",
            "L5 integrators",
            "L7",
        ],
    },
];

/// Plugin families: the file with the table, and the folder of the plugins.
const FAMILIES: &[(&str, &str)] = &[
    ("src/accel/mod.rs", "src/accel"),
    ("src/cameras/mod.rs", "src/cameras"),
    ("src/effects/mod.rs", "src/effects"),
    ("src/integrators/mod.rs", "src/integrators"),
    ("src/lights/mod.rs", "src/lights"),
    ("src/materials/mod.rs", "src/materials"),
    ("src/output/mod.rs", "src/output"),
    ("src/photons/emit.rs", "src/photons"),
];

/// Most lines of a file in `src/`.
const MOST_LINES: usize = 500;

#[test]
fn layers_look_down() {
    let mut violations = Vec::new();
    for path in rust_files("src") {
        let parts = module_path(&path);
        let Some(from) = layer_of(&parts[0]) else {
            violations.push(format!("{}: no layer for this room", path.display()));
            continue;
        };
        for (line, room) in rooms_used(&product_code(&read(&path)), &parts) {
            let to = layer_of(&room);
            let allowed = room == parts[0] || to.is_some_and(|to| from.uses.contains(&to.name));
            if !allowed {
                violations.push(format!(
                    "{}:{line}: {} ({}) uses {room} ({})",
                    path.display(),
                    parts[0],
                    from.name,
                    to.map_or("no layer", |l| l.name),
                ));
            }
        }
    }
    assert!(violations.is_empty(), "\n{}", violations.join("\n"));
}

#[test]
fn only_the_embree_backend_sees_ffi() {
    for path in rust_files("src") {
        let used = rooms_used(&product_code(&read(&path)), &module_path(&path));
        if let Some((line, _)) = used.iter().find(|(_, room)| room == "ffi") {
            assert!(
                path.starts_with("src/accel/embree"),
                "{}:{line}",
                path.display()
            );
        }
    }
    for path in rust_files("ffi") {
        let used = rooms_used(&product_code(&read(&path)), &module_path(&path));
        let foreign: Vec<_> = used.iter().filter(|(_, room)| room != "ffi").collect();
        assert!(foreign.is_empty(), "{}: {foreign:?}", path.display());
    }
}

#[test]
fn every_plugin_file_is_in_its_table_and_the_other_way_round() {
    for (table, folder) in FAMILIES {
        if !Path::new(table).exists() {
            continue;
        }
        let listed = table_entries(table);
        let mut present = BTreeSet::new();
        for (module, path) in modules(folder) {
            let text = read(&path);
            let Some((_, entry)) = text.split_once("const ENTRY") else {
                continue;
            };
            let name = entry
                .split_once("name: \"")
                .and_then(|(_, s)| s.split_once('"'));
            let name = name.map_or("", |(name, _)| name);
            assert_eq!(
                name.replace('-', "_"),
                module,
                "{}: file and plugin",
                path.display()
            );
            present.insert(module);
        }
        assert!(!present.is_empty(), "{folder}: no plugin found");
        assert_eq!(
            listed.iter().cloned().collect::<BTreeSet<_>>(),
            present,
            "{table}: the table (left) and the files with an ENTRY (right)"
        );
        assert_eq!(listed.len(), present.len(), "{table}: listed twice");
    }
}

#[test]
fn every_lobe_file_is_in_the_list_of_lobes() {
    let folder = "src/materials/lobes";
    let code = code_of(&read(Path::new("src/materials/lobes/mod.rs")));
    let list = code.split("lobes! {").last().unwrap();
    let list = &list[..list.find('}').unwrap()];
    let mut expected: BTreeSet<String> = modules(folder).into_keys().map(|m| camel(&m)).collect();
    expected.insert("Custom".into());
    let names: BTreeSet<String> = list
        .split(',')
        .filter_map(|item| item.split_once('('))
        .map(|(name, _)| name.trim().to_string())
        .collect();
    assert_eq!(names, expected, "the list (left) and the files (right)");
}

#[test]
fn plugins_have_plain_unique_names_and_one_sentence_each() {
    for (family, plugins) in Registry::builtin().families() {
        let mut names = BTreeSet::new();
        assert!(!plugins.is_empty(), "{family} has no plugin");
        for (name, doc) in plugins {
            let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
            assert!(
                !name.is_empty() && name.chars().all(plain),
                "{family} '{name}'"
            );
            assert!(names.insert(name), "{family} '{name}' twice");
            assert!(
                !doc.is_empty() && !doc.ends_with('.') && !doc.contains(". "),
                "{family} '{name}': '{doc}' is not one sentence without a final period"
            );
        }
    }
}

#[test]
fn unsafe_code_lives_in_ffi_and_says_why_it_may() {
    for path in rust_files("src") {
        let code = code_of(&read(&path));
        let at = code.lines().position(|l| words(l).any(|w| w == "unsafe"));
        assert_eq!(at, None, "{}: unsafe code outside ffi/", path.display());
    }
    for path in rust_files("ffi") {
        let text = read(&path);
        let lines: Vec<&str> = text.lines().collect();
        let mut reason = None;
        for (i, code) in code_of(&text).lines().enumerate() {
            if lines[i].contains("SAFETY:") {
                reason = Some(i);
            }
            if words(code).any(|w| w == "unsafe") {
                // One reason serves one block, right below it.
                let near = reason.take().is_some_and(|r| i - r <= 8);
                assert!(near, "{}:{}: no SAFETY: line above", path.display(), i + 1);
            }
        }
    }
}

#[test]
fn files_are_small_and_finished() {
    for path in rust_files("src") {
        let text = read(&path);
        let n = text.lines().count();
        assert!(
            n <= MOST_LINES,
            "{}: {n} lines, at most {MOST_LINES}",
            path.display()
        );
        for (i, line) in code_of(&text).lines().enumerate() {
            for stub in ["todo!", "unimplemented!"] {
                assert!(!line.contains(stub), "{}:{}: {stub}", path.display(), i + 1);
            }
        }
    }
}

/// The example's lobe, as every lobe must be: reciprocal, with the albedo it claims, which is
/// never above one; and its scene can be built.
#[test]
fn the_material_of_the_example_conserves_energy() {
    use dualight::color::Rgb;
    use dualight::materials::LobeModel;
    use dualight::math::DVec3;
    let lobe = custom_material::Rim(Rgb::ONE);
    let direction = |cos: f64, phi: f64| {
        let sin = (1.0 - cos * cos).sqrt();
        DVec3::new(sin * phi.cos(), sin * phi.sin(), cos)
    };
    for wo in [0.01, 0.2, 0.5, 0.9, 1.0].map(|cos| direction(cos, 0.3)) {
        let n = 1000;
        let (mut integral, mut sampled) = (0.0, 0.0);
        for i in 0..n {
            let u = (f64::from(i) + 0.5) / f64::from(n);
            let wi = direction(u, 2.0);
            integral += lobe.eval(wo, wi).0.r * u * std::f64::consts::TAU / f64::from(n);
            assert!((lobe.eval(wo, wi).0.r - lobe.eval(wi, wo).0.r).abs() < 1e-12);
            for j in 0..n {
                let v = (f64::from(j) + 0.5) / f64::from(n);
                let s = lobe.sample(wo, 0.5, [u, v]).unwrap();
                sampled += s.weight.r / f64::from(n * n);
            }
        }
        let albedo = lobe.albedo(wo).r;
        assert!((integral - albedo).abs() < 1e-4, "{integral} {albedo}");
        assert!((sampled - albedo).abs() < 1e-3, "{sampled} {albedo}");
        assert!(albedo <= 1.0);
    }
    let mut registry = Registry::builtin();
    registry
        .scene
        .materials
        .add(custom_material::VELVET)
        .unwrap();
    let scene = custom_material::scene(&registry).unwrap();
    assert_eq!(scene.material_names.len(), 2);
    assert!(
        registry
            .scene
            .materials
            .add(custom_material::VELVET)
            .is_err()
    );
}

/// The reader of sources used above, on cases that would fool a plain search.
#[test]
fn the_reader_of_sources_knows_comments_strings_tests_and_groups() {
    let text = r##"
        //! See [`crate::cli`].
        use crate::{math::DVec3, film};
        /* crate::cli */ const S: &str = "crate::cli \" unsafe"; const R: &str = r#"crate::cli""#;
        fn f<'a>(x: &'a str) -> char { super::super::accel::g(); super::near(); '"' }
        #[cfg(test)]
        mod tests { use crate::cli; fn g() { if true {} } }
        #[cfg(test)]
        use crate::cli;
        pub(in crate::photons) fn h() { crate::scene::f() }
    "##;
    let used = rooms_used(&product_code(text), &["materials".into(), "lobes".into()]);
    let rooms: Vec<_> = used
        .iter()
        .map(|(line, room)| (*line, room.as_str()))
        .collect();
    let expected = [
        (3, "math"),
        (3, "film"),
        (5, "accel"),
        (10, "photons"),
        (10, "scene"),
    ];
    assert_eq!(rooms, expected);
}

fn layer_of(room: &str) -> Option<&'static Layer> {
    LAYERS.iter().find(|l| l.rooms.contains(&room))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Every Rust file below `folder`, sorted. Tests run in the directory of the package.
fn rust_files(folder: &str) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![PathBuf::from(folder)]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// The module that a file of `src/` is: `["materials", "lobes"]` for `materials/lobes/mod.rs`.
fn module_path(path: &Path) -> Vec<String> {
    let inside = path.strip_prefix("src").unwrap_or(path).with_extension("");
    let mut parts: Vec<String> = inside
        .iter()
        .map(|p| p.to_string_lossy().into_owned())
        .collect();
    if parts.len() > 1 && parts.last().is_some_and(|p| p == "mod") {
        parts.pop();
    }
    parts
}

/// The modules right below a folder, with their files.
fn modules(folder: &str) -> BTreeMap<String, PathBuf> {
    let depth = Path::new(folder).iter().count();
    rust_files(folder)
        .into_iter()
        .filter(|p| module_path(p).len() == depth && p.iter().count() <= depth + 2)
        .map(|p| (module_path(&p).pop().unwrap(), p))
        .collect()
}

/// The `NAME` of every `NAME::ENTRY` in the table of a file.
fn table_entries(file: &str) -> Vec<String> {
    let code = code_of(&read(Path::new(file)));
    let at = code
        .find("pub static")
        .unwrap_or_else(|| panic!("{file}: no table"));
    let table = &code[at..];
    let table = &table[..table.find(';').unwrap()];
    let entries = table.split("::ENTRY").collect::<Vec<_>>();
    let (_, before) = entries.split_last().unwrap();
    before
        .iter()
        .map(|s| words(s).last().unwrap().to_string())
        .collect()
}

fn camel(snake: &str) -> String {
    let capital = |w: &str| w[..1].to_uppercase() + &w[1..];
    snake.split('_').map(capital).collect()
}

fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| !c.is_alphanumeric() && c != '_')
        .filter(|w| !w.is_empty())
}

/// Rooms that a file names, by `crate::` or by as many `super::` as lead to the root, with lines.
fn rooms_used(code: &str, module: &[String]) -> Vec<(usize, String)> {
    let root = "super::".repeat(module.len());
    let mut found = Vec::new();
    let mut rest = 0;
    while let Some(at) = code[rest..].find("::").map(|at| rest + at) {
        rest = at + 2;
        let path = code[..rest].trim_end_matches("super::");
        let is_root = code[..rest].ends_with("crate::") || path.len() + root.len() == rest;
        let begins = !code[rest..].starts_with("super::");
        if !is_root || !begins {
            continue;
        }
        let line = |at: usize| code[..at].matches('\n').count() + 1;
        if let Some(group) = code[rest..].strip_prefix('{') {
            // Names at the first level of braces, each at its beginning.
            let (mut depth, mut fresh) = (0, true);
            for (i, c) in group.char_indices() {
                match c {
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    '{' => depth += 1,
                    ',' if depth == 0 => fresh = true,
                    c if fresh && (c.is_alphabetic() || c == '_') => {
                        let room = words(&group[i..]).next().unwrap();
                        found.push((line(rest + 1 + i), room.to_string()));
                        fresh = false;
                    }
                    _ => {}
                }
            }
        } else if let Some(room) = words(&code[rest..]).next() {
            found.push((line(rest), room.to_string()));
        }
    }
    found
}

/// A file without comments, strings, and what is compiled for tests only. Lines stay lines.
fn product_code(text: &str) -> String {
    let mut code = code_of(text);
    while let Some(at) = code.find("#[cfg(test)]") {
        let (mut depth, mut end) = (0, code.len());
        for (i, c) in code[at..].char_indices().skip("#[cfg(test)]".len()) {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ => {}
            }
            if depth == 0 && matches!(c, '}' | ';') {
                end = at + i + 1;
                break;
            }
        }
        let blank = blanked(&code[at..end]);
        code.replace_range(at..end, &blank);
    }
    code
}

/// A file with comments, strings and character literals blanked out. Lines stay lines.
fn code_of(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = skipped(
            rest,
            out.ends_with(|c: char| c.is_alphanumeric() || c == '_'),
        );
        if length == 0 {
            out.push(c);
            rest = &rest[c.len_utf8()..];
        } else {
            out.push_str(&blanked(&rest[..length]));
            rest = &rest[length..];
        }
    }
    out
}

fn blanked(text: &str) -> String {
    text.chars()
        .map(|c| if c == '\n' { c } else { ' ' })
        .collect()
}

/// Bytes of the comment or literal that `text` begins with; 0 if it begins with neither.
fn skipped(text: &str, in_word: bool) -> usize {
    let until = |end: &str, from: usize| {
        text[from..]
            .find(end)
            .map_or(text.len(), |at| from + at + end.len())
    };
    if text.starts_with("//") {
        return until("\n", 0) - 1;
    }
    if text.starts_with("/*") {
        return until("*/", 2);
    }
    if let Some(raw) = text.strip_prefix('r').filter(|_| !in_word) {
        let hashes = raw.len() - raw.trim_start_matches('#').len();
        if raw[hashes..].starts_with('"') {
            return until(&format!("\"{}", "#".repeat(hashes)), hashes + 2);
        }
    }
    let quote = if text.starts_with('"') { '"' } else { '\'' };
    let mut inside = text.char_indices().skip(1);
    if !text.starts_with(quote) {
        return 0;
    }
    if quote == '\'' {
        // `'a` is a lifetime, `'a'` a character.
        let mut next = text.chars().skip(1);
        if next.next() != Some('\\') && next.next() != Some('\'') {
            return 0;
        }
    }
    while let Some((i, c)) = inside.next() {
        if c == '\\' {
            inside.next();
        } else if c == quote {
            return i + 1;
        }
    }
    text.len()
}
