//! Files as others find them: EXR read by an independent reader, atomic writing.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod openexr;

use std::fs;
use std::io;
use std::path::Path;
use std::process::Command;

use dualight::color::Rgb;
use dualight::film::{Component, Film, Image, PixelSample, Tile};
use dualight::math::DVec3;
use dualight::output::{self, Metadata, OUTPUTS, OutputSettings};
use dualight::registry::Table;

/// A film of odd sizes with every layer different in every pixel.
fn image() -> Image {
    let (width, height) = (37, 21);
    let mut film = Film::new(width, height);
    let sums = (0..width * height)
        .map(|k| {
            let k = f64::from(k);
            let mut s = PixelSample {
                alpha: 1.0,
                albedo: Rgb::new(0.25, 0.5, 0.75),
                normal: DVec3::new(0.0, 0.6, 0.8),
                position: DVec3::new(k, -k, 0.1 * k),
                depth: 1.0 / 3.0 + k,
                photons: [k * 1e6, 0.5],
                ..Default::default()
            };
            for (c, component) in Component::ALL.into_iter().enumerate() {
                s.add(component, Rgb::new(k, 0.5 * k, 1.0) * (1.0 + c as f64));
            }
            s
        })
        .collect();
    film.add(&Tile {
        x: 0,
        y: 0,
        width,
        height,
        sums,
        samples: 1,
    });
    film.develop()
}

fn metadata() -> Metadata {
    Metadata {
        command_line: "dualight render 'ä→b.glb'".into(),
        seed: u64::MAX,
        spp: 64,
        render_seconds: 1.5,
    }
}

fn write(image: &Image, path: &Path) -> dualight::error::Result<()> {
    let settings = OutputSettings::default();
    output::write(&Table::new(OUTPUTS), image, &settings, &metadata(), path)
}

fn names(directory: &Path) -> Vec<String> {
    fs::read_dir(directory)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn an_independent_reader_finds_every_channel() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    let image = image();
    write(&image, &path).unwrap();
    let file = openexr::parse(&fs::read(&path).unwrap());

    assert_eq!((file.width, file.height), (37, 21));
    let mut expected = vec!["A", "B", "G", "R", "Z"];
    let layers = ["direct", "specular", "caustics", "indirect", "albedo"];
    let dotted: Vec<String> = layers
        .iter()
        .flat_map(|l| ["R", "G", "B"].map(|c| format!("{l}.{c}")))
        .chain(
            ["N", "P"]
                .iter()
                .flat_map(|l| ["X", "Y", "Z"].map(|c| format!("{l}.{c}"))),
        )
        .chain(["photons.global".into(), "photons.caustic".into()])
        .collect();
    expected.extend(dotted.iter().map(String::as_str));
    expected.sort_unstable();
    // The format wants them sorted.
    let found: Vec<&str> = file.channels.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(found, expected);

    for layer in &image.layers {
        for c in &layer.channels {
            let name = match layer.name.as_str() {
                "" => c.name.clone(),
                l => format!("{l}.{}", c.name),
            };
            let half = file.channels.iter().any(|(n, half)| *n == name && *half);
            assert_eq!(half, c.half, "{name}");
            for (a, b) in file.data[&name].iter().zip(&c.data) {
                let bound = if half { b.abs() / 2048.0 } else { 0.0 };
                assert!((a - b).abs() <= bound, "{name}: {a} instead of {b}");
            }
        }
    }

    let text = |name: &str| String::from_utf8_lossy(&file.attributes[name].1).into_owned();
    assert!(text("software").starts_with("Dualight "));
    assert_eq!(text("commandLine"), metadata().command_line);
    assert_eq!(text("seed"), u64::MAX.to_string());
    assert!(!text("commit").is_empty());
    assert_eq!(file.attributes["samplesPerPixel"].1, 64_i32.to_le_bytes());
    assert_eq!(file.attributes["renderSeconds"].1, 1.5_f64.to_le_bytes());
    assert_eq!(file.attributes["chromaticities"].0, "chromaticities");
}

#[test]
fn what_is_written_is_read_back() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    let image = image();
    write(&image, &path).unwrap();
    let back = output::read(&path).unwrap();
    assert_eq!((back.width, back.height), (image.width, image.height));
    assert_eq!(back.channel("", "Z"), image.channel("", "Z"));
    assert_eq!(back.channel("P", "X"), image.channel("P", "X"));
    assert_eq!(
        back.channel("photons", "global"),
        image.channel("photons", "global")
    );
    for layer in ["", "direct", "caustics"] {
        let (a, b) = (back.rgb(layer).unwrap(), image.rgb(layer).unwrap());
        for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
            assert!((a - b).abs() <= b / 2048.0);
        }
    }
}

/// What the official library makes of it; skipped where Python or the package is missing.
#[test]
fn the_official_library_reads_it() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    write(&image(), &path).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/check_exr.py");
    let Ok(out) = Command::new("python3").arg(script).arg(&path).output() else {
        eprintln!("skipped: no python3");
        return;
    };
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    match out.status.code() {
        Some(77) => eprintln!("skipped: {said}"),
        code => assert_eq!(code, Some(0), "{said}"),
    }
}

#[test]
fn colours_that_half_cannot_hold_are_stored_in_full() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    let mut image = image();
    image.layers[0].channels[0].data[0] = 1e6;
    write(&image, &path).unwrap();
    let file = openexr::parse(&fs::read(&path).unwrap());
    assert_eq!(file.data["R"][0], 1e6);
    let half = |n: &str| file.channels.iter().any(|(m, half)| m == n && *half);
    assert!(!half("R") && !half("G") && half("direct.R"));
}

#[test]
fn damaged_files_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    write(&image(), &path).unwrap();
    let whole = fs::read(&path).unwrap();
    let mut bad: Vec<Vec<u8>> = [0, 3, 8, 100, 700, whole.len() / 2, whole.len() - 1]
        .iter()
        .map(|n| whole[..*n].to_vec())
        .collect();
    bad.push(b"\x89PNG\r\n\x1a\n".to_vec());
    for bytes in bad {
        fs::write(&path, &bytes).unwrap();
        let e = output::read(&path).unwrap_err();
        assert_eq!(e.exit_code(), 1);
        assert!(e.to_string().contains("OpenEXR"), "{e}");
    }
}

#[test]
fn a_png_shows_the_beauty_image() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.png");
    write(&image(), &path).unwrap();
    let png = image::open(&path).unwrap();
    assert_eq!((png.width(), png.height()), (37, 21));
    // Pixel 0 has (0, 0, 1 + 2 + 3 + 4).
    assert_eq!(png.to_rgb8().get_pixel(0, 0).0, [0, 0, 255]);
    assert!(!png.color().has_alpha());
}

#[test]
fn a_failed_write_leaves_the_old_file_and_nothing_else() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    fs::write(&path, "old").unwrap();
    let failed = output::write_atomically(&path, |sink| {
        sink.write_all(&[7; 100_000])?;
        Err(io::Error::other("the disk is full"))
    });
    let message = failed.unwrap_err().to_string();
    assert!(message.contains("the disk is full") && message.contains("make room"));
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(names(directory.path()), ["a.exr"]);

    // A panicking encoder does not leave anything either.
    let panicked = std::panic::catch_unwind(|| {
        output::write_atomically(&path, |_| std::panic::resume_unwind(Box::new(())))
    });
    assert!(panicked.is_err());
    assert_eq!(names(directory.path()), ["a.exr"]);
}

#[test]
fn checking_changes_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    output::check_writable(&path).unwrap();
    assert!(names(directory.path()).is_empty());
    fs::write(&path, "old").unwrap();
    output::check_writable(&path).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(names(directory.path()), ["a.exr"]);
}

#[test]
fn unwritable_places_are_named_with_a_remedy() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("file");
    fs::write(&file, "x").unwrap();
    let protected = directory.path().join("protected.exr");
    fs::write(&protected, "x").unwrap();
    let mut permissions = fs::metadata(&protected).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&protected, permissions).unwrap();
    for (path, part) in [
        (
            directory.path().join("missing/a.exr"),
            "is not a directory; create it",
        ),
        (file.join("a.exr"), "is not a directory"),
        (directory.path().to_path_buf(), "name a file inside it"),
        (protected, "write-protected"),
    ] {
        for result in [
            output::check_writable(&path),
            output::write_atomically(&path, |_| Ok(())),
        ] {
            let e = result.unwrap_err();
            assert_eq!(e.exit_code(), 1);
            assert!(e.to_string().contains(part), "{e}");
        }
    }
    assert_eq!(names(directory.path()).len(), 2);
}

#[cfg(unix)]
#[test]
fn permissions_and_links_are_respected() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let directory = tempfile::tempdir().unwrap();
    let (real, link) = (directory.path().join("real"), directory.path().join("link"));
    fs::write(&real, "old").unwrap();
    fs::set_permissions(&real, fs::Permissions::from_mode(0o640)).unwrap();
    symlink(&real, &link).unwrap();
    output::write_atomically(&link, |sink| sink.write_all(b"new")).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read_to_string(&real).unwrap(), "new");
    let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&real), 0o640);

    // A new file gets what the umask leaves, as one that is made plainly.
    let (plain, ours) = (
        directory.path().join("plain"),
        directory.path().join("ours"),
    );
    fs::write(&plain, "").unwrap();
    output::write_atomically(&ours, |_| Ok(())).unwrap();
    assert_eq!(mode(&ours), mode(&plain));
}
