//! What a command line means: settings for each stage, checked against the plugins there are.
//! Touches no file.

use std::path::PathBuf;
use std::time::Duration;

use super::args::{RenderArgs, SceneArgs, Solid, Units};
use super::values::{Size, Sky};
use crate::effects;
use crate::error::{Error, Result};
use crate::import::{EnvironmentOption, EnvironmentSource, ImportOptions, LightUnits, SolidGlass};
use crate::integrators::{IntegratorEntry, IntegratorSettings, PhotonNeeds};
use crate::output::{self, OutputSettings};
use crate::photons::GuideBy;
use crate::pipeline::{
    PhotonFile, PixelSampling, Progressive, RenderSettings, sampling_for, settings_for,
};
use crate::plugins::Registry;
use crate::scene::{Omit, Scene};

/// Width of an image whose size is not given.
const DEFAULT_WIDTH: u32 = 512;

/// Largest height that a camera's aspect leads to; who wants more gives a size.
const MAX_DEFAULT_HEIGHT: f64 = 8192.0;

/// Time between two writings of a rendering in passes, if not said.
const WRITE_EVERY: Duration = Duration::from_secs(60);

/// Frames in a second where nothing else is said: Blender's default.
const DEFAULT_FPS: f64 = 24.0;

/// Where statistics go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StatisticsTarget {
    /// Standard output.
    Stdout,
    /// A file.
    File(PathBuf),
}

/// What `dualight render` is to do.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The scene's file.
    pub scene: PathBuf,
    /// How it is read.
    pub import: ImportOptions,
    /// The images to write.
    pub outputs: Vec<PathBuf>,
    /// How they are written.
    pub output_settings: OutputSettings,
    /// Where the statistics go, if anywhere.
    pub statistics: Option<StatisticsTarget>,
    /// When to stop, from the start of the command.
    pub time_limit: Option<Duration>,
    /// How often to write what there is while rendering in passes.
    pub write_every: Duration,
    /// Where the film is kept, if anywhere.
    pub resume: Option<PathBuf>,
    /// Where photons are kept, if anywhere.
    pub photons: Option<PhotonFile>,
    /// Whether to print nothing but errors.
    pub quiet: bool,
    size: Option<Size>,
    /// What depends on the image's size is not settled before the camera is known.
    settings: RenderSettings,
    args: RenderArgs,
}

impl Plan {
    /// Makes sense of what was typed.
    ///
    /// # Errors
    /// Names that no plugin has, extensions that no format has, options that contradict one
    /// another.
    pub fn new(args: &RenderArgs, registry: &Registry) -> Result<Self> {
        if let Some(name) = named_integrator(args) {
            registry.integrators.find(name)?;
        }
        // Defaults get their names here, for the reports.
        let accelerator = registry.accelerators.choose(args.accel.as_deref())?;
        let emission = registry.emissions.choose(args.emission.as_deref())?;
        let effects = args.effects.clone().unwrap_or_else(|| "auto".into());
        let omit = effects::omissions(&effects, &registry.effects)?;
        for path in &args.outputs {
            output::format_of(&registry.outputs, path)?;
        }
        if args.pixel_sampling == Some(PixelSampling::Adaptive) && progressive(args).is_some() {
            return Err(Error::Usage(
                "--pixel-sampling adaptive shares out a known --spp; leave out --target-error, \
                 --time-limit, --write-every and --resume"
                    .into(),
            ));
        }
        let photons = match (&args.save_photons, &args.load_photons) {
            (Some(path), _) => Some(PhotonFile::Save(path.clone())),
            (None, Some(path)) => Some(PhotonFile::Load(path.clone())),
            (None, None) => None,
        };
        if photons.is_some() && progressive(args).is_some() {
            return Err(Error::Usage(
                "--save-photons and --load-photons are for a known --spp, since each independent \
                 pass has other photons; leave out --target-error, --time-limit, --write-every and \
                 --resume"
                    .into(),
            ));
        }
        let plan = Self {
            scene: args.scene.file.clone(),
            import: ImportOptions {
                omit,
                ..import_options(&args.scene)
            },
            outputs: args.outputs.clone(),
            output_settings: OutputSettings {
                exposure: args.exposure,
            },
            statistics: args.json.as_ref().map(|file| match file {
                None => StatisticsTarget::Stdout,
                Some(path) => StatisticsTarget::File(path.clone()),
            }),
            time_limit: args.time_limit,
            write_every: args.write_every.unwrap_or(WRITE_EVERY),
            resume: args.resume.clone(),
            photons,
            quiet: args.quiet,
            size: args.size,
            settings: RenderSettings {
                // The scene has a say in it.
                integrator: named_integrator(args).map(Into::into),
                accelerator: Some(accelerator.name.into()),
                emission: Some(emission.name.into()),
                effects,
                width: 0,
                height: 0,
                spp: args.spp.unwrap_or(match args.target_error {
                    Some(_) => u32::MAX,
                    None => args.quality.spp(),
                }),
                // The integrator has a say in it.
                pixel_sampling: args.pixel_sampling.unwrap_or_default(),
                interpolation: args.interpolation,
                progressive: progressive(args),
                crop: args.crop.map(|c| c.0),
                camera: args.camera.clone(),
                threads: args.threads.map(|n| n as usize),
                integrator_settings: IntegratorSettings::default(),
            },
            args: args.clone(),
        };
        if let Some(size) = plan.size {
            plan.check_crop(size)?;
        }
        Ok(plan)
    }

    /// The integrator that was named, if any was.
    pub fn named_integrator(&self) -> Option<&str> {
        named_integrator(&self.args)
    }

    /// Whether an option was given that only photons have a use for.
    pub fn asks_for_photons(&self) -> bool {
        let a = &self.args;
        a.photons.is_some()
            || a.caustic_photons.is_some()
            || a.nearest.is_some()
            || a.gather.is_some()
            || a.emission.is_some()
            || a.guide.is_some()
            || self.photons.is_some()
    }

    /// Options that were given and that an integrator has no use for.
    pub fn idle_options(&self, needs: PhotonNeeds) -> Vec<&'static str> {
        let a = &self.args;
        let photons = needs == PhotonNeeds::None;
        let gather = needs != PhotonNeeds::All;
        [
            ("--photons", gather && a.photons.is_some()),
            ("--gather", gather && a.gather.is_some()),
            ("--shadow-rays", gather && a.shadow_rays.is_some()),
            ("--caustic-photons", photons && a.caustic_photons.is_some()),
            ("--nearest", photons && a.nearest.is_some()),
            ("--emission", photons && a.emission.is_some()),
            ("--guide", photons && a.guide.is_some()),
            ("--save-photons", photons && a.save_photons.is_some()),
            ("--load-photons", photons && a.load_photons.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, idle)| idle.then_some(name))
        .collect()
    }

    /// The settings for a scene, whose camera may settle the image's size.
    ///
    /// # Errors
    /// A crop outside the image.
    pub fn settings_for(
        &self,
        scene: &Scene,
        integrator: &str,
        registry: &Registry,
    ) -> Result<RenderSettings> {
        let size = self.size.unwrap_or_else(|| {
            let camera = match &self.settings.camera {
                None => scene.cameras.first(),
                Some(name) => scene.cameras.iter().find(|c| c.name == *name),
            };
            default_size(camera.and_then(|c| c.aspect))
        });
        self.check_crop(size)?;
        Ok(RenderSettings {
            width: size.width,
            height: size.height,
            integrator: Some(integrator.into()),
            pixel_sampling: self.pixel_sampling_for(registry.integrators.find(integrator)?),
            integrator_settings: integrator_settings(&self.args, size),
            ..self.settings.clone()
        })
    }

    fn pixel_sampling_for(&self, integrator: &IntegratorEntry) -> PixelSampling {
        self.args
            .pixel_sampling
            .unwrap_or(match self.settings.progressive {
                None => sampling_for(integrator),
                Some(_) => PixelSampling::Uniform,
            })
    }

    fn check_crop(&self, size: Size) -> Result<()> {
        match self.settings.crop {
            Some([x0, y0, x1, y1]) if x1 > size.width || y1 > size.height => {
                Err(Error::Usage(format!(
                    "--crop {x0},{y0},{x1},{y1} reaches beyond the image; stay within 0,0,{},{}",
                    size.width, size.height
                )))
            }
            _ => Ok(()),
        }
    }
}

/// The integrator that was named, if any was.
fn named_integrator(args: &RenderArgs) -> Option<&str> {
    args.integrator.as_deref().filter(|name| *name != "auto")
}

/// What was asked for, and for the rest what suits an image of that size.
fn integrator_settings(args: &RenderArgs, size: Size) -> IntegratorSettings {
    let pixels = u64::from(size.width) * u64::from(size.height);
    let defaults = settings_for(args.quality.spp(), pixels);
    IntegratorSettings {
        seed: args.seed,
        max_depth: args.max_depth,
        roulette: !args.no_roulette,
        photons: args.photons.unwrap_or(defaults.photons),
        caustic_photons: args.caustic_photons.unwrap_or(defaults.caustic_photons),
        nearest: args.nearest.map_or(defaults.nearest, |n| n as usize),
        guide: args.guide.unwrap_or_else(|| guide(args)),
        gather_rays: args.gather.unwrap_or(defaults.gather_rays),
        background: args.background,
        shadow_rays: args.shadow_rays.unwrap_or(defaults.shadow_rays),
    }
}

/// What photons are guided by if nobody says: those of an animation's frames, and those that files
/// keep, are the same whoever looks.
fn guide(args: &RenderArgs) -> GuideBy {
    let kept = args.save_photons.is_some() || args.load_photons.is_some();
    let animated = args.scene.time.is_some() || args.scene.frame.is_some();
    match kept || animated {
        true => GuideBy::Light,
        false => GuideBy::View,
    }
}

/// Whether to render in independent passes: for whoever asks for what only they can give.
fn progressive(args: &RenderArgs) -> Option<Progressive> {
    let wanted = args.target_error.is_some()
        || args.time_limit.is_some()
        || args.write_every.is_some()
        || args.resume.is_some();
    wanted.then_some(Progressive {
        target_error: args.target_error,
    })
}

/// How a scene's file is to be read.
pub fn import_options(args: &SceneArgs) -> ImportOptions {
    ImportOptions {
        light_units: match args.light_units {
            Units::Auto => LightUnits::Auto,
            Units::Blender => LightUnits::Blender,
            Units::Photometric => LightUnits::Photometric,
            Units::Radiometric => LightUnits::Radiometric,
            Units::Watts => LightUnits::Watts,
        },
        solid_glass: match args.solid_glass {
            Solid::Auto => SolidGlass::Auto,
            Solid::Always => SolidGlass::Always,
            Solid::Never => SolidGlass::Never,
        },
        scene: args.name.clone(),
        time: args
            .time
            .or_else(|| Some(args.frame? / args.fps.unwrap_or(DEFAULT_FPS))),
        animation: args.animation.clone(),
        variant: args.variant.clone(),
        environment: args.environment.clone().map(|source| EnvironmentOption {
            source: match source {
                Sky::Image(path) => EnvironmentSource::Image(path),
                Sky::Color(c) => EnvironmentSource::Color(c),
            },
            strength: args.environment_strength,
            rotation: args.environment_rotation.to_radians(),
            seen_by_camera: true,
        }),
        omit: Omit::default(),
    }
}

/// What to tell about the camera of a scene that brings none, if it is looked through: `asked` is
/// the one that was asked for.
pub fn camera_note(scene: &Scene, asked: Option<&str>) -> Option<&'static str> {
    (scene.cameras.is_empty() && asked.is_none()).then_some(
        "the scene has no camera: one was made that frames all of it; give the file cameras, and \
         --camera NAME looks through another than its first",
    )
}

/// The size of an image for a camera of the given aspect, if it has one.
pub(super) fn default_size(aspect: Option<f64>) -> Size {
    let aspect = aspect.filter(|a| a.is_finite() && *a > 0.0).unwrap_or(1.0);
    let height = (f64::from(DEFAULT_WIDTH) / aspect).round();
    Size {
        width: DEFAULT_WIDTH,
        height: height.clamp(1.0, MAX_DEFAULT_HEIGHT) as u32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::{self, Command};

    const SQUARE: Size = Size {
        width: 512,
        height: 512,
    };

    fn plan(options: &str) -> Result<Plan> {
        let line = format!("dualight render s.glb -o a.exr {options}");
        match args::parse(line.split_whitespace()).unwrap().command {
            Command::Render(r) => Plan::new(&r, &Registry::builtin()),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn defaults_are_those_of_the_stages() {
        let p = plan("").unwrap();
        let first = |name: &str| Some(name.to_string());
        let expected = RenderSettings {
            width: 0,
            height: 0,
            integrator: None,
            accelerator: first(crate::accel::ACCELERATORS[0].name),
            emission: first(crate::photons::EMISSIONS[0].name),
            ..RenderSettings::default()
        };
        assert_eq!(p.settings, expected);
        // The command line knows that a still picture has one camera.
        let defaults = IntegratorSettings {
            guide: GuideBy::View,
            ..IntegratorSettings::default()
        };
        assert_eq!(integrator_settings(&p.args, SQUARE), defaults);
    }

    #[test]
    fn pixels_are_sampled_adaptively_where_that_pays() {
        let registry = Registry::builtin();
        for (options, integrator, want) in [
            ("", "photon", PixelSampling::Adaptive),
            ("", "path", PixelSampling::Uniform),
            ("", "hybrid", PixelSampling::Uniform),
            ("--target-error 0.01", "photon", PixelSampling::Uniform),
            ("--pixel-sampling uniform", "photon", PixelSampling::Uniform),
            ("--pixel-sampling adaptive", "path", PixelSampling::Adaptive),
        ] {
            let plan = plan(options).unwrap();
            let entry = registry.integrators.find(integrator).unwrap();
            assert_eq!(
                plan.pixel_sampling_for(entry),
                want,
                "{options} {integrator}"
            );
        }
    }

    #[test]
    fn options_arrive_where_they_belong() {
        let p = plan("--quality draft --photons 7k").unwrap();
        let i = integrator_settings(&p.args, SQUARE);
        assert_eq!(
            (p.settings.spp, i.photons, i.caustic_photons),
            (4, 7000, 250_000)
        );
        let p = plan(
            "--gather off --photons 2M --caustic-photons 10k --nearest 5 --shadow-rays 3 \
             --no-roulette --max-depth 4 --seed 9 --threads 2 --effects all,-caustics",
        )
        .unwrap();
        let i = integrator_settings(&p.args, SQUARE);
        assert_eq!(
            (i.gather_rays, i.photons, i.caustic_photons),
            (0, 2_000_000, 10_000)
        );
        assert_eq!((i.nearest, i.shadow_rays, i.roulette), (5, 3, false));
        assert_eq!(
            (i.max_depth, i.seed, p.settings.threads),
            (Some(4), 9, Some(2))
        );
        assert_eq!(p.settings.effects, "all,-caustics");
    }

    #[test]
    fn mistakes_are_usage_errors_that_name_the_remedy() {
        for (options, part) in [
            ("--integrator magic", "known: photon"),
            ("--accel magic", "known: "),
            ("--emission magic", "known: "),
            ("--effects magic", "+NAME"),
            ("--effects +magic", "known: direct"),
            ("--effects=", "+NAME"),
            ("-o b.jpg", ".exr, .png"),
            ("--size 8x8 --crop 0,0,9,8", "stay within 0,0,8,8"),
        ] {
            let e = plan(options).unwrap_err();
            assert_eq!(e.exit_code(), 2, "{options}");
            assert!(e.to_string().contains(part), "{options}: {e}");
        }
    }

    #[test]
    fn the_camera_settles_the_height() {
        let height = |a| default_size(a).height;
        assert_eq!(height(None), 512);
        assert_eq!(height(Some(16.0 / 9.0)), 288);
        assert_eq!((height(Some(1e9)), height(Some(1e-9))), (1, 8192));
        assert_eq!((height(Some(f64::NAN)), height(Some(-1.0))), (512, 512));
    }
}
