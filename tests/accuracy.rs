//! `dualight accuracy`: what is measured is consistent, and the page works in a browser, offline.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use clap::ValueEnum;
use dualight::control::Control;
use dualight::import::{self, ImportOptions};
use dualight::pipeline::{self, PixelSampling, Quality, RenderSettings};
use dualight::plugins::Registry;
use dualight::report::accuracy::{
    self, Analysis, Circumstances, Clock, Preset, Study, StudyOptions, methods,
};

const METHODS: [&str; 3] = ["path", "photon", "photon+pixels"];

/// A small study of the box, made once.
fn measured() -> &'static (Study, Analysis) {
    static STUDY: OnceLock<(Study, Analysis)> = OnceLock::new();
    STUDY.get_or_init(|| {
        let registry = accuracy::with_measured_backends(Registry::builtin()).unwrap();
        let scene = import::load(
            Path::new("scenes/box.gltf"),
            &ImportOptions::default(),
            registry.scene.clone(),
        )
        .unwrap();
        let mut chosen = methods(&registry);
        chosen.retain(|m| METHODS.contains(&m.name.as_str()));
        let base = RenderSettings {
            width: 24,
            height: 20,
            ..Default::default()
        };
        let photon = registry.integrators.find("photon").unwrap();
        let preset = |quality: &Quality| Preset {
            quality: *quality,
            settings: quality.apply(&base, photon),
            reason: "the test says so".into(),
        };
        let options = StudyOptions {
            methods: chosen,
            presets: Quality::value_variants().iter().map(preset).collect(),
            base: base.clone(),
            repeats: 3,
            budget: 2.0,
            changes: true,
            reference: None,
            reference_error: 0.1,
            exposure: 0.0,
            clock: Clock::Wall,
        };
        let study = accuracy::study(&scene, &registry, options, &Control::default());
        let study = study.unwrap().unwrap();
        let analysis = study.analyse();
        (study, analysis)
    })
}

fn page() -> String {
    let (study, analysis) = measured();
    let circumstances = Circumstances {
        scene: "box <&>.gltf".into(),
        ..Default::default()
    };
    accuracy::page(study, analysis, &circumstances, &Registry::builtin()).unwrap()
}

#[test]
fn errors_fall_and_are_the_sum_of_their_parts() {
    let (study, analysis) = measured();
    for c in &analysis.curves {
        let ladder: Vec<_> = analysis.curve(&c.method).collect();
        assert!(ladder.len() >= 2, "{}", c.method);
        for pair in ladder.windows(2) {
            assert!(
                pair[1].error().value < pair[0].error().value,
                "{}",
                c.method
            );
            assert!(pair[1].spp == 4 * pair[0].spp);
        }
    }
    for p in &analysis.points {
        // The whole and four components, each the sum of what changes with the seed and what
        // does not.
        assert_eq!(p.layers.len(), 5);
        for l in &p.layers {
            let sum = l.noise.value + l.bias.value;
            assert!(
                (l.total.value - sum).abs() <= 1e-9 + 1e-6 * sum.abs(),
                "{l:?}"
            );
            assert!(l.total.low <= l.total.value && l.total.value <= l.total.high);
        }
        assert!(p.seconds.value > 0.0 && p.trimmed.value > 0.0);
        assert_eq!(p.flip.is_some(), cfg!(feature = "flip"));
    }
    // Path tracing has no bias: what there is of it lies within the noise.
    for p in analysis.curve("path") {
        let whole = &p.layers[0];
        assert!(
            whole.bias.value.abs() < 0.5 * whole.noise.value,
            "{whole:?}"
        );
    }
    assert!(analysis.floor.iter().all(|f| *f >= 1.0));
    assert!(study.reference.error[0] > 0.0);
}

#[test]
fn single_changes_do_what_they_say() {
    let (_, analysis) = measured();
    assert_eq!(analysis.effects.len(), accuracy::CHANGES.len());
    let of = |name: &str| analysis.effects.iter().find(|e| e.change == name).unwrap();
    let samples = of("4 times the samples");
    assert!(samples.error.value < 0.7, "{samples:?}");
    // What that costs is counted here: seconds of pictures as small as these, of which photons take
    // the most, tell of what else the machine does.
    let before: u32 = analysis
        .base
        .as_ref()
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    let changed = analysis
        .points
        .iter()
        .find(|p| p.name == samples.change)
        .unwrap();
    assert_eq!(changed.spp, 4 * before);
    assert!(samples.time.value > 0.0, "{samples:?}");
}

/// `--quality` renders the box by photons, and shares out the samples of its pixels: its presets are
/// on no other curve.
#[test]
fn presets_are_marked_on_the_curve_of_what_they_render() {
    let (study, analysis) = measured();
    let names = analysis.presets.iter().map(|p| p.preset);
    assert!(names.eq(["draft", "normal", "high", "reference"]));
    let marked: Vec<_> = analysis
        .points
        .iter()
        .filter(|p| p.preset.is_some())
        .collect();
    // Two rungs are measured however slow the machine is, and the second is the first preset.
    assert_eq!(marked[0].preset, Some("draft"), "{:?}", analysis.presets);
    let svg = accuracy::overview(analysis, Clock::Wall, "").svg();
    for p in &analysis.presets {
        assert_eq!(p.method.as_deref(), Some("photon+pixels"));
        let own = marked.iter().find(|m| m.preset == Some(p.preset));
        let measured = own.map(|m| (m.seconds, m.error()));
        assert_eq!(p.measured, measured, "{}", p.preset);
        assert_eq!(svg.contains(&format!(">{}<", p.preset)), own.is_some());
        let Some(own) = own else {
            continue;
        };
        // What the command line would render by.
        assert_eq!((own.name.as_str(), own.spp), ("photon+pixels", p.spp));
        let settings = study.settings.iter().find(|s| s.preset == Some(p.preset));
        let settings = &settings.unwrap().settings;
        let quality = Quality::from_str(p.preset, false).unwrap();
        let of_command = pipeline::settings_for(quality.spp(), 24 * 20);
        assert_eq!(settings.integrator_settings, of_command);
        assert_eq!(settings.integrator.as_deref(), Some("photon"));
        assert_eq!(settings.pixel_sampling, PixelSampling::Adaptive);
    }
    // Each is better than the one before.
    for b in analysis.presets.iter().filter_map(|p| p.times_better) {
        assert!(b > 1.0, "{b}");
    }
    let page = page();
    assert!(page.contains("the test says so") && page.contains("times longer"));
}

#[test]
fn tables_hold_every_point() {
    let (study, analysis) = measured();
    let csv = accuracy::csv(analysis);
    let mut lines = csv.lines();
    let columns = lines.next().unwrap().split(',').count();
    let names: Vec<&str> = lines
        .map(|l| {
            let cells: Vec<&str> = l.split(',').collect();
            assert_eq!(cells.len(), columns, "{l}");
            cells[0]
        })
        .collect();
    assert_eq!(names.len(), 5 * analysis.points.len());
    let json = accuracy::json(study, analysis, &Circumstances::default());
    assert_eq!(
        json["points"].as_array().unwrap().len(),
        analysis.points.len()
    );
    assert_eq!(json["curves"][0]["method"], "path");
    assert!(accuracy::text(analysis).contains("noise floor"));
    let markdown = accuracy::markdown(analysis);
    let levels: usize = analysis.curves.iter().map(|c| c.times.len()).sum();
    let rows = markdown.lines().filter(|l| l.starts_with('|')).count();
    let parts = analysis.curves.iter().flat_map(|c| &c.components);
    let parts: usize = parts.map(|c| c.times.len()).sum();
    // Four tables with two lines of head each.
    let presets = Quality::value_variants().len();
    assert_eq!(rows, 8 + levels + parts + presets + accuracy::CHANGES.len());
    let times = accuracy::times_csv(analysis);
    assert_eq!(times.lines().count(), 1 + levels + parts);
    let columns = |l: &str| l.split(',').count();
    let mut widths = times.lines().map(columns);
    let head = widths.next().unwrap();
    assert!(widths.all(|n| n == head));
}

/// What the table says of a component is what its points say: between the two points of a ladder
/// whose errors enclose the level lies the time to it, and the ratio is that of two such times.
#[test]
fn times_of_components_follow_their_own_errors() {
    let (_, analysis) = measured();
    let layers = |c: &accuracy::Curve| c.components.iter().map(|c| c.layer).collect::<Vec<_>>();
    for c in &analysis.curves {
        // All that the box has, in every curve alike.
        assert_eq!(layers(c), layers(&analysis.curves[0]));
        assert!(layers(c).contains(&"caustics") && layers(c).contains(&"indirect"));
    }
    let mut passed = 0;
    for (c, k) in analysis
        .curves
        .iter()
        .flat_map(|c| (0..c.components.len()).map(move |k| (c, k)))
    {
        let error = |p: &accuracy::Point| {
            let of = p.layers.iter().find(|l| l.layer == c.components[k].layer);
            of.unwrap().total.value
        };
        let ladder: Vec<_> = analysis.curve(&c.method).collect();
        for (i, l) in c.components[k].times.iter().enumerate() {
            assert_eq!(l.error, analysis.curves[0].components[k].times[i].error);
            let Some(seconds) = &l.seconds else {
                continue;
            };
            passed += 1;
            let around = ladder.windows(2).find(|w| error(w[1]) <= l.error).unwrap();
            assert!(error(around[0]) > l.error);
            // On a busy machine the finer of two short renderings may take less time.
            let [a, b] = [around[0], around[1]].map(|p| p.seconds.value);
            let within = a.min(b) * (1.0 - 1e-9)..=a.max(b) * (1.0 + 1e-9);
            assert!(within.contains(&seconds.value), "{l:?}");
            let first = &analysis.curves[0].components[k].times[i].seconds;
            if let (Some(r), Some(first)) = (&l.ratio, first) {
                assert!(
                    (r.value * seconds.value / first.value - 1.0).abs() < 1e-6,
                    "{l:?}"
                );
            }
        }
    }
    assert!(passed >= 4, "{passed}");
}

/// What a browser is asked to look at once the page is loaded.
const PROBE: &str = r#"<script>
addEventListener("load", () => {
  const seen = e => { const r = e.getBoundingClientRect(); return r.width > 50 && r.height > 50; };
  const all = s => [...document.querySelectorAll(s)];
  const images = all("img"), plots = all("svg");
  const slider = document.getElementById("slider"), over = document.getElementById("over");
  slider.value = 25; slider.dispatchEvent(new Event("input"));
  const left = document.getElementById("left");
  left.selectedIndex = 1; left.dispatchEvent(new Event("change"));
  const report = {
    errors: window.problems, images: images.length, plots: plots.length,
    broken: images.filter(i => !i.complete || i.naturalWidth === 0).length,
    hidden: images.concat(plots).filter(e => !seen(e)).length,
    clip: over.style.clipPath, swapped: over.src === document.getElementById(left.value).src,
  };
  document.body.innerHTML = "<pre id=report>" + JSON.stringify(report) + "</pre>";
});
</script>"#;

#[test]
fn the_page_works_in_a_browser_without_a_network() {
    let html = page();
    for outside in ["http:", "src=\"//", "@import", "url("] {
        let text = html.replace("http://www.w3.org/2000/svg", "");
        assert!(!text.contains(outside), "{outside}");
    }
    assert!(html.contains("box &lt;&amp;&gt;.gltf"));
    let browser = ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|b| Command::new(b).arg("--version").output().is_ok());
    let Some(browser) = browser else {
        eprintln!("skipped: no Chromium in the path");
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("page.html");
    let early = "<script>window.problems = []; addEventListener('error', e => \
                 problems.push(e.message)); console.error = m => problems.push(m);</script>";
    let probed = html
        .replace("</head>", &format!("{early}</head>"))
        .replace("</body>", &format!("{PROBE}</body>"));
    std::fs::write(&path, probed).unwrap();
    let out = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"])
        .args([
            "--host-resolver-rules=MAP * ~NOTFOUND",
            "--virtual-time-budget=5000",
        ])
        .arg(format!("--user-data-dir={}", directory.path().display()))
        .arg(format!("file://{}", path.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&out.stdout);
    let report = dom.split_once("<pre id=\"report\">").unwrap().1;
    let report: serde_json::Value =
        serde_json::from_str(report.split_once("</pre>").unwrap().0).unwrap();
    assert_eq!(report["errors"].as_array().unwrap().len(), 0, "{report}");
    assert_eq!(
        (&report["broken"], &report["hidden"]),
        (&0.into(), &0.into()),
        "{report}"
    );
    // Reference, the methods and their errors, and two in the comparison.
    assert_eq!(report["images"], 3 + 2 * METHODS.len(), "{report}");
    assert!(report["plots"].as_u64().unwrap() >= 6, "{report}");
    assert!(report["clip"].as_str().unwrap().contains("75%"), "{report}");
    assert_eq!(report["swapped"], true, "{report}");
}
