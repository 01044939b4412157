//! What was typed. Parsing touches no file.

use std::path::PathBuf;
use std::time::Duration;

use clap::error::ErrorKind;
use clap::{Args, Parser, Subcommand, ValueEnum};

use super::measure_args::{AccuracyArgs, BenchArgs};
use super::photon_args::{PhotonsArgs, ReproduceArgs};
use super::values::{self, Crop, Size};
use crate::photons::GuideBy;
use crate::pipeline::{PixelSampling, Quality};
use crate::report::ErrorMap;

/// A photon-mapping renderer for glTF scenes.
#[derive(Clone, Debug, Parser)]
#[command(name = "dualight", version = VERSION, max_term_width = 100)]
#[command(after_help = "\
Examples:
  dualight render scene.glb -o scene.exr -o scene.png
  dualight render scene.glb -o out.png --size 1920x1080 --spp 64 --photons 5M --time-limit 10m
  dualight diff out.exr reference.exr -o error.png
  dualight compare scene.glb --rays 10M
  dualight accuracy scene.glb -o accuracy.html --budget 10m

Exit status: 0 done, 1 rendering or reading or writing failed or backends differ, 2 usage, 3 the file requires \
something unsupported, 4 stopped at the time limit with a valid image, 130 interrupted.")]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const VERSION: &str = concat!(
    env!("CARGO_PKG_VERSION"),
    " (",
    env!("DUALIGHT_GIT_COMMIT"),
    ")"
);

/// What to do.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Render a scene to image files
    Render(Box<RenderArgs>),
    /// Tell what a scene holds and which effects it calls for
    Inspect(InspectArgs),
    /// List everything that can be chosen by name
    Plugins,
    /// Tell how far an image is from a reference
    Diff(DiffArgs),
    /// Compare two ray tracing backends on the same rays; every difference is explained or a bug
    Compare(CompareArgs),
    /// Measure what accuracy costs in time: error against seconds, method by method
    Accuracy(AccuracyArgs),
    /// Measure how fast every stage is, ray tracing backends side by side
    Bench(BenchArgs),
    /// Draw the stored photons as the camera sees them
    Photons(PhotonsArgs),
    /// Do the paper's experiment: conventional against adaptive emission of half as many photons
    Reproduce(ReproduceArgs),
}

/// What the numbers of a file's lights mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Units {
    /// By the exporter if it is Blender's (watts before its version 3.4), otherwise photometric
    Auto,
    /// As Blender's exporter writes them: watts times 683 for lamps
    Blender,
    /// Candela and lux, as glTF says; divided by 683 lm/W
    Photometric,
    /// W/sr and W/m², taken as they are; Blender's mode "Unitless"
    Radiometric,
    /// Watts of points and spots, W/m² of suns: Blender before 3.4, and its mode "Raw"
    Watts,
}

/// Which glass without a volume is solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Solid {
    /// In files of Blender's exporter, on closed meshes
    Auto,
    /// All
    Always,
    /// None: thin walls, as glTF says
    Never,
}

/// Which scene, and how it is read.
#[derive(Clone, Debug, Args)]
pub struct SceneArgs {
    /// glTF scene (.glb or .gltf)
    #[arg(value_name = "SCENE")]
    pub file: PathBuf,
    /// What the numbers of the file's lights mean
    #[arg(long, value_enum, default_value = "auto", hide_possible_values = false)]
    pub light_units: Units,
    /// Which glass without KHR_materials_volume is solid
    #[arg(long, value_enum, default_value = "auto", hide_possible_values = false)]
    pub solid_glass: Solid,
    /// Light from all around: an image of the sky (.hdr, .exr) or a colour R,G,B; replaces the file's
    #[arg(long, value_name = "FILE|R,G,B")]
    pub environment: Option<values::Sky>,
    /// What the environment is multiplied by
    #[arg(long, value_name = "X", default_value = "1", value_parser = values::factor)]
    pub environment_strength: f64,
    /// Turns the environment about the vertical axis, counter-clockwise seen from above
    #[arg(
        long,
        value_name = "DEGREES",
        default_value = "0",
        allow_negative_numbers = true
    )]
    pub environment_rotation: f64,
    /// Scene within the file, if it holds several [default: the file's default]
    #[arg(long = "scene", value_name = "NAME")]
    pub name: Option<String>,
    /// Show animations at this moment, in seconds [default: the rest pose]
    #[arg(long, value_name = "SECONDS", value_parser = values::moment, group = "moment")]
    #[arg(allow_negative_numbers = true)]
    pub time: Option<f64>,
    /// Show animations at this frame; the same as --time N/FPS
    #[arg(long, value_name = "N", value_parser = values::moment, group = "moment")]
    #[arg(allow_negative_numbers = true)]
    pub frame: Option<f64>,
    /// Frames in a second [default: 24, as Blender's]
    #[arg(long, value_name = "FPS", value_parser = values::rate, requires = "frame", conflicts_with = "time")]
    pub fps: Option<f64>,
    /// Show one animation alone; needs --time or --frame [default: all of them]
    #[arg(long, value_name = "NAME", requires = "moment")]
    pub animation: Option<String>,
    /// Variant of the materials, if the file has any [default: the file's default]
    #[arg(long, value_name = "NAME")]
    pub variant: Option<String>,
}

/// Options of `dualight render`.
#[derive(Clone, Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as the help of the command")]
    pub scene: SceneArgs,

    /// Image to write; .exr holds every layer in linear light, .png the image as shown. May be
    /// given several times. Written whole or not at all
    #[arg(
        short,
        long = "output",
        value_name = "FILE",
        required_unless_present = "json"
    )]
    #[arg(help_heading = "Output")]
    pub outputs: Vec<PathBuf>,
    /// Exposure of .png images in stops: each doubles the brightness
    #[arg(
        long,
        value_name = "STOPS",
        default_value = "0",
        allow_hyphen_values = true
    )]
    #[arg(value_parser = values::stops, help_heading = "Output")]
    pub exposure: f64,
    /// Write statistics as JSON to FILE, or to standard output without one
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true)]
    #[arg(help_heading = "Output")]
    pub json: Option<Option<PathBuf>>,
    /// Print nothing but errors
    #[arg(short, long, help_heading = "Output")]
    pub quiet: bool,

    /// Size of the image in pixels [default: 512 wide, as high as the camera asks for]
    #[arg(long, value_name = "WxH", help_heading = "Image")]
    pub size: Option<Size>,
    /// How many samples and photons, in one word; options that say more exactly go before it
    #[arg(long, value_enum, default_value = "normal", help_heading = "Image")]
    pub quality: Quality,
    /// Camera samples per pixel [default: that of --quality; no limit with --target-error]
    #[arg(long, value_name = "N", value_parser = values::positive_u32)]
    #[arg(help_heading = "Image")]
    pub spp: Option<u32>,
    /// How samples are shared among pixels: evenly, or more where edges are forecast and samples
    /// differ. Adaptive is for a known --spp, not for images in passes; a --crop is the same as in
    /// the whole image if both are uniform [default: adaptive for the integrator photon where it
    /// can be, else uniform]
    #[arg(long, value_enum, help_heading = "Image")]
    pub pixel_sampling: Option<PixelSampling>,
    /// Whether adaptive sampling interpolates indirect light in pixels without an edge
    #[arg(long, value_name = "on|off", default_value = "on", value_parser = values::on_off)]
    #[arg(help_heading = "Image", action = clap::ArgAction::Set)]
    pub interpolation: bool,
    /// Camera to look through; auto frames the whole scene [default: the first of the scene, or auto]
    #[arg(long, value_name = "NAME", help_heading = "Image")]
    pub camera: Option<String>,
    /// Render only the pixels from X0,Y0 (upper left) to just before X1,Y1; the rest is black
    #[arg(long, value_name = "X0,Y0,X1,Y1", help_heading = "Image")]
    pub crop: Option<Crop>,
    /// Seed of all random numbers; equal seeds give equal images
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Image")]
    pub seed: u64,

    /// How light is computed: auto (photon where sharp mirrors or glass throw caustics, path
    /// elsewhere), or a name [default: auto; see dualight plugins]
    #[arg(long, value_name = "NAME", help_heading = "Light transport")]
    pub integrator: Option<String>,
    /// What is simulated: auto (what the scene calls for), all, or changes to that such as
    /// +caustics,-indirect
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    #[arg(help_heading = "Light transport")]
    pub effects: Option<String>,
    /// Most scattering events between camera and light [default: no limit]
    #[arg(long, value_name = "N", help_heading = "Light transport")]
    pub max_depth: Option<u32>,
    /// Never end long paths by chance
    #[arg(long, help_heading = "Light transport")]
    pub no_roulette: bool,
    /// Whether the camera sees the environment
    #[arg(long, value_name = "on|off", default_value = "on", value_parser = values::on_off)]
    #[arg(help_heading = "Image", action = clap::ArgAction::Set)]
    pub background: bool,
    /// Shadow rays per camera sample at the first diffuse surface
    #[arg(long, value_name = "N", value_parser = values::positive_u32)]
    #[arg(help_heading = "Light transport")]
    pub shadow_rays: Option<u32>,

    /// Photons sent into the scene; 10k and 2M are understood [default: 4 for each pixel]
    #[arg(long, value_name = "N", value_parser = values::photons, help_heading = "Photons")]
    pub photons: Option<u64>,
    /// Photons sent toward mirrors and glass [default: 4 for each pixel]
    #[arg(long, value_name = "N", value_parser = values::photons, help_heading = "Photons")]
    pub caustic_photons: Option<u64>,
    /// Photons in a density estimate: more are smoother, fewer sharper
    #[arg(long, value_name = "N", value_parser = values::positive_u32)]
    #[arg(help_heading = "Photons")]
    pub nearest: Option<u32>,
    /// Final-gather rays per camera sample; off shows the photon map itself
    #[arg(long, value_name = "N|off", value_parser = values::gather, help_heading = "Photons")]
    pub gather: Option<u32>,
    /// How photons leave the lights [see dualight plugins]
    #[arg(long, value_name = "NAME", help_heading = "Photons")]
    pub emission: Option<String>,
    /// What emission is guided by [default: view; light with --time, --frame and files of photons]
    #[arg(long, value_enum, value_name = "NAME", help_heading = "Photons")]
    pub guide: Option<GuideBy>,
    /// Keep the photon maps in FILE. An image of more than 16 samples per pixel takes new photons
    /// now and then; kept are the first
    #[arg(
        long,
        value_name = "FILE",
        help_heading = "Photons",
        conflicts_with = "load_photons"
    )]
    pub save_photons: Option<PathBuf>,
    /// Take the photon maps from FILE instead of tracing photons: same scene and settings, any
    /// camera, and the same image to the bit
    #[arg(long, value_name = "FILE", help_heading = "Photons")]
    pub load_photons: Option<PathBuf>,

    /// Ray tracing backend [see dualight plugins]
    #[arg(long, value_name = "NAME", help_heading = "Machine")]
    pub accel: Option<String>,
    /// Threads [default: one per processor]
    #[arg(long, value_name = "N", value_parser = values::positive_u32, help_heading = "Machine")]
    pub threads: Option<u32>,
    /// Stop after 30s, 5m or 1h with the image as it is then (exit status 4)
    #[arg(long, value_name = "TIME", value_parser = values::duration, help_heading = "Ending")]
    pub time_limit: Option<Duration>,
    /// Stop when the image's relMSE, estimated from independent passes, is this small
    #[arg(long, value_name = "E", value_parser = values::error, help_heading = "Ending")]
    pub target_error: Option<f64>,
    /// Write the images, and the film of --resume, so often while rendering in passes
    #[arg(long, value_name = "TIME", value_parser = values::duration, help_heading = "Ending")]
    pub write_every: Option<Duration>,
    /// Keep the film in FILE, and go on from it if it is there already
    #[arg(long, value_name = "FILE", help_heading = "Ending")]
    pub resume: Option<PathBuf>,
}

/// Options of `dualight inspect`.
#[derive(Clone, Debug, Args)]
pub struct InspectArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as the help of the command")]
    pub scene: SceneArgs,
    /// Print what is found as JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of `dualight diff`.
#[derive(Clone, Debug, Args)]
pub struct DiffArgs {
    /// Image to judge (.exr)
    #[arg(value_name = "A.exr")]
    pub image: PathBuf,
    /// Reference to judge it by (.exr), of the same size
    #[arg(value_name = "B.exr")]
    pub reference: PathBuf,
    /// Picture of the error: false colours as .png, the numbers themselves as .exr
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// What the picture shows
    #[arg(long, value_enum, default_value = "relative", requires = "output")]
    pub error_map: ErrorMap,
    /// Layer to compare, for instance caustics [default: the main image]
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// Exposure in stops at which FLIP looks at both
    #[arg(
        long,
        value_name = "STOPS",
        default_value = "0",
        allow_hyphen_values = true
    )]
    #[arg(value_parser = values::stops)]
    pub exposure: f64,
    /// Print the numbers as JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of `dualight compare`.
#[derive(Clone, Debug, Args)]
pub struct CompareArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as the help of the command")]
    pub scene: SceneArgs,
    /// Rays in all: camera, shadow, photon, bounced, random, and aimed at edges; 10M is understood
    #[arg(long, value_name = "N", default_value = "1M", value_parser = values::positive)]
    pub rays: u64,
    /// Backend to judge [default: the first of dualight plugins]
    #[arg(long, value_name = "NAME")]
    pub accel: Option<String>,
    /// Backend to judge it by, which is taken to be exact [default: bvh; for bvh: linear]
    #[arg(long, value_name = "NAME")]
    pub reference: Option<String>,
    /// Samples per pixel of the two pictures; 0 renders none
    #[arg(long, value_name = "N", default_value = "4")]
    pub spp: u32,
    /// Size of the two pictures in pixels [default: 128 wide, as high as the camera asks for]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// How many of the worst rays the report lists
    #[arg(long, value_name = "N", default_value = "10")]
    pub worst: u32,
    /// Ask again about the worst rays of a report instead of new ones
    #[arg(long, value_name = "FILE", conflicts_with_all = ["rays", "worst"])]
    pub replay: Option<PathBuf>,
    /// Write the report as JSON to FILE, or to standard output without one
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true)]
    pub json: Option<Option<PathBuf>>,
    /// Print nothing but the report and errors
    #[arg(short, long)]
    pub quiet: bool,
    /// Threads [default: one per processor]
    #[arg(long, value_name = "N", value_parser = values::positive_u32)]
    pub threads: Option<u32>,
}

/// What to say when there is nothing to run: text that was asked for, or an error in one line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Help or the version, for standard output.
    Asked(String),
    /// The help of a command that was typed without anything.
    Help(String),
    /// An error in one line.
    Error(String),
}

/// Understands the words of a command line, the program's name first.
///
/// # Errors
/// What to print instead of running.
pub fn parse(
    words: impl IntoIterator<Item = impl Into<std::ffi::OsString> + Clone>,
) -> Result<Cli, Refusal> {
    Cli::try_parse_from(words).map_err(|e| match e.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => Refusal::Asked(e.to_string()),
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => Refusal::Help(e.to_string()),
        _ => Refusal::Error(condense(&e.to_string())),
    })
}

/// The message of a parse error in one line: without the synopsis, hints joined by semicolons.
fn condense(message: &str) -> String {
    let mut out = String::new();
    for line in message.lines().map(str::trim) {
        if line.starts_with("Usage:") || line.starts_with("For more information") {
            break;
        }
        let line = line.strip_prefix("error: ").unwrap_or(line);
        if line.is_empty() {
            continue;
        }
        if !out.is_empty() {
            out.push_str(if out.ends_with(':') { " " } else { "; " });
        }
        out.push_str(line);
    }
    out.push_str("; see dualight --help");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Result<Cli, Refusal> {
        parse(line.split(' '))
    }

    fn error(line: &str) -> String {
        match words(line) {
            Err(Refusal::Error(e)) => e,
            other => panic!("{line}: {other:?}"),
        }
    }

    #[test]
    fn the_declaration_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn a_full_command_line_is_understood() {
        let line = "dualight render s.glb -o a.exr -o a.png --spp 10k --size 3x2 --crop 0,0,1,1 \
                    --exposure -1.5 --effects -caustics,+direct --gather off --json \
                    --photons 2M --time-limit 1h30m --light-units photometric";
        let Ok(Cli {
            command: Command::Render(r),
        }) = words(&line.split_whitespace().collect::<Vec<_>>().join(" "))
        else {
            panic!("not understood");
        };
        assert_eq!(
            (r.outputs.len(), r.spp, r.exposure),
            (2, Some(10_000), -1.5)
        );
        assert_eq!(r.effects.as_deref(), Some("-caustics,+direct"));
        assert_eq!((r.gather, r.photons), (Some(0), Some(2_000_000)));
        assert_eq!(r.json, Some(None));
        assert_eq!(r.scene.light_units, Units::Photometric);
    }

    #[test]
    fn json_takes_a_file_only_with_an_equals_sign() {
        // Otherwise `--json scene.glb` would overwrite the scene.
        let Ok(Cli {
            command: Command::Render(r),
        }) = words("dualight render --json s.glb")
        else {
            panic!("not understood");
        };
        assert_eq!((r.json, r.scene.file), (Some(None), "s.glb".into()));
    }

    #[test]
    fn errors_are_one_line_with_a_remedy() {
        for (line, part) in [
            ("dualight render s.glb -o a.png --spp 0", "at least 1"),
            ("dualight render s.glb -o a.png --size 0x0", "640x480"),
            ("dualight render s.glb -o a.png --sp 4", "'--spp'"),
            ("dualight render s.glb", "--output <FILE>"),
            ("dualight render -o a.png", "<SCENE>"),
            ("dualight rendr", "'render'"),
            ("dualight inspect s.glb --time 1 --frame 2", "--frame"),
            ("dualight inspect s.glb --time 1 --fps 24", "--f"),
            ("dualight inspect s.glb --animation Walk", "--time"),
            ("dualight inspect s.glb --frame 1 --fps 0", "frames"),
            ("dualight diff a.exr b.exr --error-map flip", "--output"),
            (
                "dualight render s.glb -o a.png --light-units lux",
                "photometric",
            ),
        ] {
            let e = error(line);
            assert!(e.contains(part) && !e.contains('\n'), "{line}: {e}");
        }
    }

    #[test]
    fn help_is_no_error() {
        assert!(matches!(
            words("dualight render --help"),
            Err(Refusal::Asked(_))
        ));
        assert!(matches!(
            words("dualight --version"),
            Err(Refusal::Asked(_))
        ));
        assert!(matches!(words("dualight"), Err(Refusal::Help(_))));
    }
}
