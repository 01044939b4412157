//! What was typed after the commands that show photons. Parsing touches no file.

use std::path::PathBuf;

use clap::Args;

use super::args::SceneArgs;
use super::values::{self, Size};

/// Options of `dualight photons`.
#[derive(Clone, Debug, Args)]
pub struct PhotonsArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as the help of the command")]
    pub scene: SceneArgs,
    /// Picture to write: .png shows a dot for each photon, orange for those of the caustic map;
    /// .exr has the numbers per pixel and the levels of emission cells, too
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// How photons leave the lights [see dualight plugins]
    #[arg(long, value_name = "NAME")]
    pub emission: Option<String>,
    /// Photons sent into the scene; 10k and 2M are understood
    #[arg(long, value_name = "N", default_value = "100k", value_parser = values::photons)]
    pub photons: u64,
    /// Photons sent toward mirrors and glass
    #[arg(long, value_name = "N", default_value = "5k", value_parser = values::photons)]
    pub caustic_photons: u64,
    /// Draw each photon's first diffuse surface only
    #[arg(long)]
    pub first: bool,
    /// Size of the picture in pixels [default: 512 wide, as high as the camera asks for]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Camera to look through; auto frames the whole scene [default: the first of the scene, or auto]
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Ray tracing backend [see dualight plugins]
    #[arg(long, value_name = "NAME")]
    pub accel: Option<String>,
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

/// Options of `dualight reproduce`.
#[derive(Clone, Debug, Args)]
pub struct ReproduceArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as the help of the command")]
    pub scene: SceneArgs,
    /// Report to write, in Markdown; its pictures go to a folder named images beside it
    #[arg(short, long, value_name = "FILE.md")]
    pub output: PathBuf,
    /// Image to judge by (.exr), of the same size [default: computed by path]
    #[arg(long, value_name = "FILE.exr")]
    pub reference: Option<PathBuf>,
    /// Camera samples per pixel of a computed reference
    #[arg(long, value_name = "N", default_value = "1024", value_parser = values::positive_u32)]
    pub reference_spp: u32,
    /// Camera samples per pixel
    #[arg(long, value_name = "N", default_value = "16", value_parser = values::positive_u32)]
    pub spp: u32,
    /// Size of the pictures in pixels
    #[arg(long, value_name = "WxH", default_value = "256x256")]
    pub size: Size,
    /// How often everything is done, in turns and each time with another seed
    #[arg(long, value_name = "N", default_value = "3", value_parser = values::positive_u32)]
    pub repeats: u32,
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
