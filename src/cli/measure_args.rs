//! What was typed after the commands that measure. Parsing touches no file.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::args::SceneArgs;
use super::values::{self, Size};
use crate::report::accuracy::Clock;
use crate::report::bench::Synthetic;

/// Options of `dualight accuracy`.
#[derive(Clone, Debug, Args)]
pub struct AccuracyArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as the help of the command")]
    pub scene: SceneArgs,
    /// Report to write: .html the whole page, .svg the first plot, .md its tables, .csv and .json the
    /// numbers, .times.csv the seconds to each error. May be given several times [default: only the
    /// table on the terminal]
    #[arg(short, long = "output", value_name = "FILE")]
    pub outputs: Vec<PathBuf>,
    /// Methods, the first being what the others are compared with [default: all there are]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub methods: Vec<String>,
    /// Image to judge by (.exr), of the same size; one rendered in passes (by --target-error or
    /// --time-limit) tells its own error [default: computed by path]
    #[arg(long, value_name = "FILE.exr")]
    pub reference: Option<PathBuf>,
    /// Error of a computed reference, as a part of the smallest error measured
    #[arg(long, value_name = "X", default_value = "0.1", value_parser = values::factor)]
    pub reference_error: f64,
    /// Time for all of it, about; the ladders are planned to fit
    #[arg(long, value_name = "TIME", default_value = "5m", value_parser = values::duration)]
    pub budget: Duration,
    /// Seeds per setting
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub seeds: u32,
    /// Leave out the single changes that show what precision costs
    #[arg(long)]
    pub no_changes: bool,
    /// Which time counts
    #[arg(long, value_enum, default_value = "wall")]
    pub clock: Clock,
    /// Size of the pictures in pixels [default: 128 wide, as high as the camera asks for]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Camera to look through; auto frames the whole scene [default: the first of the scene, or auto]
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Exposure in stops at which FLIP and the page look at pictures
    #[arg(
        long,
        value_name = "STOPS",
        default_value = "0",
        allow_hyphen_values = true
    )]
    #[arg(value_parser = values::stops)]
    pub exposure: f64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Threads [default: one per processor]
    #[arg(long, value_name = "N", value_parser = values::positive_u32)]
    pub threads: Option<u32>,
    /// Print nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Options of `dualight bench`.
#[derive(Clone, Debug, Args)]
pub struct BenchArgs {
    /// glTF scenes (.glb or .gltf)
    #[arg(value_name = "SCENE", required_unless_present_any = ["synthetic", "scaling"])]
    pub files: Vec<PathBuf>,
    /// Made-up scene: terrain, forest, spheres or soup, with a number of primitives. May be given
    /// several times
    #[arg(long, value_name = "KIND:N", value_parser = |s: &str| Synthetic::parse(s, values::count))]
    pub synthetic: Vec<Synthetic>,
    /// Backends, side by side [default: all but linear]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub accel: Vec<String>,
    /// Rays of each order
    #[arg(long, value_name = "N", default_value = "1M", value_parser = values::positive_u32)]
    pub rays: u32,
    /// How often everything is measured
    #[arg(long, value_name = "N", default_value = "5", value_parser = values::positive_u32)]
    pub repeats: u32,
    /// Width and height of the pictures
    #[arg(long, value_name = "N", default_value = "256", value_parser = clap::value_parser!(u32).range(1..=8192))]
    pub size: u32,
    /// Numbers of threads; several show how all scales [default: one per processor]
    #[arg(long, value_name = "N,N", value_delimiter = ',', value_parser = values::positive_u32)]
    pub threads: Vec<u32>,
    /// How all scales: terrains of these sizes on all threads (or the most of --threads), the
    /// smallest also on 1, 2, 4, … threads (or those of --threads)
    #[arg(long, value_name = "N,N", num_args = 0..=1, require_equals = true, value_delimiter = ',')]
    #[arg(default_missing_values = ["1M", "5M", "20M"], value_parser = values::count)]
    pub scaling: Option<Vec<u64>>,
    /// Seed of rays and photons
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Earlier output of this command to compare with. Status 1 if a median became worse by more
    /// than the tolerance and the ranges of all repeats do not meet; times need three repeats on
    /// both sides; what the baseline does not have is named and not judged
    #[arg(long, value_name = "FILE")]
    pub baseline: Option<PathBuf>,
    /// How much worse something may become
    #[arg(long, value_name = "PERCENT", default_value = "5%", value_parser = values::percent)]
    pub tolerance: f64,
    /// Print nothing but the line for programs, and errors
    #[arg(short, long)]
    pub quiet: bool,
}
