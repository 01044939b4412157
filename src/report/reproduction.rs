//! The paper's experiment, done again: the box by conventional emission, and by adaptive emission
//! of half as many photons (Namae and Makino 2002, section 6, table 2 and figures 6 to 9).

use std::fmt::Write;

use super::diff::Pair;
use super::photon_view::View;
use crate::control::Control;
use crate::error::Result;
use crate::film::Image;
use crate::photons::{Guidance, GuideBy, PhotonSettings};
use crate::pipeline::{self, PixelSampling, RenderSettings};
use crate::plugins::Registry;
use crate::sampling::hash2;
use crate::scene::Scene;
use crate::stats::Statistics;

/// One way to emit.
#[derive(Clone, Copy, Debug)]
pub struct Contestant {
    /// What the table calls it.
    pub title: &'static str,
    /// Name of its pictures.
    pub name: &'static str,
    /// The emission's name.
    pub emission: &'static str,
    /// How samples are shared among pixels: the paper's second step, or evenly.
    pub pixels: PixelSampling,
    /// Photons of the global and of the caustic map.
    pub photons: [u64; 2],
    /// The paper's figures, if it has this one: stored in either map, and seconds in all.
    pub paper: Option<([u64; 2], f64)>,
}

/// The paper's two, and between them what tells the effect of the number from that of the places,
/// and that of photons from that of pixels.
pub const CONTESTANTS: [Contestant; 4] = [
    Contestant {
        title: "conventional",
        name: "conventional",
        emission: "uniform",
        pixels: PixelSampling::Uniform,
        photons: [100_000, 5_000],
        paper: Some(([368_558, 7_177], 2485.040)),
    },
    Contestant {
        title: "conventional, half",
        name: "half",
        emission: "uniform",
        pixels: PixelSampling::Uniform,
        photons: [50_000, 2_500],
        paper: None,
    },
    Contestant {
        title: "adaptive photons",
        name: "adaptive-photons",
        emission: "adaptive",
        pixels: PixelSampling::Uniform,
        photons: [50_000, 2_500],
        paper: None,
    },
    Contestant {
        title: "adaptive",
        name: "adaptive",
        emission: "adaptive",
        pixels: PixelSampling::Adaptive,
        photons: [50_000, 2_500],
        paper: Some(([196_367, 3_852], 630.690)),
    },
];

/// What one contestant came to.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Who.
    pub contestant: Contestant,
    /// Counts and times of the first repeat.
    pub statistics: Statistics,
    /// For each repeat: seconds of the stages of [`STAGES`], and of all of it.
    pub seconds: Vec<[f64; STAGES.len() + 1]>,
    /// For each repeat: relative mean squared error.
    pub errors: Vec<f64>,
    /// The picture of the first repeat.
    pub image: Image,
    /// Its stored photons as the camera sees them.
    pub photons: Image,
}

/// The stages that are told, by the names of the pipeline.
pub const STAGES: [&str; 3] = ["photons", "photon maps", "pixels"];

impl Contestant {
    /// Settings of its pictures.
    pub fn settings(&self, base: &RenderSettings) -> RenderSettings {
        let mut out = base.clone();
        out.emission = Some(self.emission.into());
        out.pixel_sampling = self.pixels;
        out.integrator_settings.photons = self.photons[0];
        out.integrator_settings.caustic_photons = self.photons[1];
        // The paper's emission is shared by derivatives alone.
        out.integrator_settings.guide = GuideBy::Off;
        out
    }
}

/// Renders all contestants `repeats` times in turns, each time with another seed; `None` if
/// stopped. Without a reference to read, one is rendered by `path` with `reference_spp` samples.
///
/// # Errors
/// As [`pipeline::render`]; a reference of another size.
pub fn run(
    scene: &Scene,
    registry: &Registry,
    base: &RenderSettings,
    (reference, reference_spp): (Option<Image>, u32),
    repeats: u32,
    control: &Control,
) -> Result<Option<Vec<Outcome>>> {
    let render = |settings: &RenderSettings| {
        let rendering = pipeline::render(scene, settings, registry, control)?;
        Ok::<_, crate::error::Error>(rendering.stopped.is_none().then_some(rendering))
    };
    let reference = match reference {
        Some(image) => image,
        None => {
            let mut settings = RenderSettings {
                integrator: Some("path".into()),
                spp: reference_spp,
                ..base.clone()
            };
            // No picture that it judges has this seed.
            settings.integrator_settings.seed = hash2(base.integrator_settings.seed, u64::MAX);
            match render(&settings)? {
                Some(rendering) => rendering.film.develop(),
                None => return Ok(None),
            }
        }
    };
    let mut out: Vec<Outcome> = Vec::new();
    for repeat in 0..repeats {
        for (k, contestant) in CONTESTANTS.iter().enumerate() {
            let mut settings = contestant.settings(base);
            settings.integrator_settings.seed += u64::from(repeat);
            let Some(rendering) = render(&settings)? else {
                return Ok(None);
            };
            let image = rendering.film.develop();
            let error = Pair::new(&image, &reference, None)?.compare(0.0).rel_mse;
            let seconds = stage_seconds(&rendering.statistics);
            match out.get_mut(k) {
                Some(o) => {
                    o.seconds.push(seconds);
                    o.errors.push(error);
                }
                None => out.push(Outcome {
                    contestant: *contestant,
                    statistics: rendering.statistics,
                    seconds: vec![seconds],
                    errors: vec![error],
                    image,
                    photons: photons(scene, registry, &settings, control)?,
                }),
            }
        }
    }
    Ok(control.stopped().is_none().then_some(out))
}

/// The stored photons of a picture as its camera sees them.
fn photons(
    scene: &Scene,
    registry: &Registry,
    settings: &RenderSettings,
    control: &Control,
) -> Result<Image> {
    let emission = registry.emissions.choose(settings.emission.as_deref())?;
    let backend = registry
        .accelerators
        .choose(settings.accelerator.as_deref())?;
    let camera = pipeline::choose_camera(scene, settings, registry)?;
    let options = &settings.integrator_settings;
    let told = PhotonSettings {
        seed: options.seed,
        global: options.photons,
        caustic: options.caustic_photons,
        nearest: options.nearest,
        max_depth: options.max_depth,
        roulette: options.roulette,
        guidance: Guidance::Off,
    };
    pipeline::in_pool(settings.threads, || {
        scene.geometry.prepare();
        let accel = (backend.build)(&scene.geometry, rayon::current_num_threads())?;
        let view = View {
            scene,
            accel: &*accel,
            camera: &*camera,
            width: settings.width,
            height: settings.height,
        };
        Ok(view.photons(emission, &told, false, control).image())
    })?
}

fn stage_seconds(statistics: &Statistics) -> [f64; STAGES.len() + 1] {
    let of = |name: &str| {
        let all = statistics.stages.iter().filter(|s| s.stage == name);
        all.map(|s| s.seconds).sum::<f64>()
    };
    let [a, b, c] = STAGES.map(of);
    [a, b, c, statistics.stages.iter().map(|s| s.seconds).sum()]
}

/// The mean, and its standard error where there are two values at least.
fn mean(values: &[f64]) -> (f64, Option<f64>) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (
        mean,
        (values.len() > 1).then(|| (squares / (n * (n - 1.0))).sqrt()),
    )
}

/// The middle value: one repeat that something disturbed does not count.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// A number with its thousands apart.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(c);
    }
    out
}

/// The table in Markdown, the paper's figures in brackets beside ours.
pub fn table(outcomes: &[Outcome]) -> String {
    let mut out = String::from("| |");
    for o in outcomes {
        let _ = write!(out, " {} |", o.contestant.title);
    }
    out += "\n|---|";
    out += &"---:|".repeat(outcomes.len());
    out.push('\n');
    let mut row = |name: &str, cell: &dyn Fn(&Outcome) -> String| {
        let _ = write!(out, "| {name} |");
        for o in outcomes {
            let _ = write!(out, " {} |", cell(o));
        }
        out.push('\n');
    };
    let paper = |o: &Outcome, i: usize| match o.contestant.paper {
        Some((stored, _)) => format!(" ({})", grouped(stored[i])),
        None => String::new(),
    };
    for (i, map) in ["global", "caustic"].into_iter().enumerate() {
        let counts = |o: &Outcome| match i {
            0 => o.statistics.global_photons,
            _ => o.statistics.caustic_photons,
        };
        row(&format!("emitted, {map} map"), &|o| {
            let paper = o.contestant.paper.map(|_| o.contestant.photons[i]);
            let paper = paper.map_or(String::new(), |n| format!(" ({})", grouped(n)));
            grouped(counts(o).emitted) + &paper
        });
        row(&format!("check rays, {map} map"), &|o| {
            grouped(counts(o).checked)
        });
        row(&format!("pilot photons, {map} map"), &|o| {
            grouped(counts(o).pilot)
        });
        row(&format!("stored, {map} map"), &|o| {
            grouped(counts(o).stored) + &paper(o, i)
        });
    }
    for (i, stage) in STAGES.into_iter().enumerate() {
        row(&format!("seconds, {stage}"), &|o| {
            format!("{:.2}", median(o.seconds.iter().map(|s| s[i]).collect()))
        });
    }
    row("seconds, all", &|o| {
        let own = median(o.seconds.iter().map(|s| s[STAGES.len()]).collect());
        let paper = o.contestant.paper.map(|(_, s)| format!(" ({s:.0})"));
        format!("{own:.2}{}", paper.unwrap_or_default())
    });
    row("relMSE", &|o| {
        let (mean, error) = mean(&o.errors);
        match error {
            Some(e) => format!("{mean:.5} ± {e:.5}"),
            None => format!("{mean:.5}"),
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_and_averaged() {
        assert_eq!(
            [0, 12, 1234, 368_558, 1_000_000].map(grouped),
            ["0", "12", "1 234", "368 558", "1 000 000"]
        );
        assert_eq!(mean(&[1.0]), (1.0, None));
        assert_eq!(mean(&[1.0, 3.0]), (2.0, Some(1.0)));
        assert_eq!(median(vec![3.0, 100.0, 1.0]), 3.0);
    }
}
