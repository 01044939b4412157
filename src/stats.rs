//! What a run counted and how long its stages took; written as JSON.

pub mod tally;

use serde::{Deserialize, Serialize};

/// Rays traced, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RayCounts {
    /// From the camera.
    pub camera: u64,
    /// Toward lights.
    pub shadow: u64,
    /// Continuations of camera paths.
    pub bounce: u64,
    /// Final gather.
    pub gather: u64,
    /// Photon path segments.
    pub photon: u64,
    /// Traced to plan where photons leave.
    pub check: u64,
}

impl RayCounts {
    /// Adds the counts of another part of the work.
    pub fn add(&mut self, o: &Self) {
        self.camera += o.camera;
        self.shadow += o.shadow;
        self.bounce += o.bounce;
        self.gather += o.gather;
        self.photon += o.photon;
        self.check += o.check;
    }

    /// The counts of two parts of the work together.
    pub fn plus(mut self, o: Self) -> Self {
        self.add(&o);
        self
    }
}

/// What became of the photons of one map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhotonCounts {
    /// Photons that left lights.
    pub emitted: u64,
    /// More photons that decided the kernels and were not stored.
    pub pilot: u64,
    /// Rays traced to plan the emission.
    pub checked: u64,
    /// Cells that it was planned in.
    pub cells: u64,
    /// Photons stored.
    pub stored: u64,
    /// Of the emitted ones, those that hit nothing useful and were given up.
    pub discarded: u64,
    /// Flux that left the lights, W (sum of RGB).
    pub flux_emitted: f64,
    /// Flux that was absorbed at surfaces or in media.
    pub flux_absorbed: f64,
    /// Flux that left the scene.
    pub flux_escaped: f64,
    /// Flux that was cut off at the depth limit.
    pub flux_cut: f64,
}

impl PhotonCounts {
    /// Adds those of one more pass to those of the `passes` before. What is counted is summed;
    /// flux is the mean of the passes, each of which carries all of it.
    pub fn add_pass(&mut self, o: &Self, passes: u32) {
        self.emitted += o.emitted;
        self.pilot += o.pilot;
        self.checked += o.checked;
        self.cells += o.cells;
        self.stored += o.stored;
        self.discarded += o.discarded;
        let share = 1.0 / (f64::from(passes) + 1.0);
        for (mean, new) in [
            (&mut self.flux_emitted, o.flux_emitted),
            (&mut self.flux_absorbed, o.flux_absorbed),
            (&mut self.flux_escaped, o.flux_escaped),
            (&mut self.flux_cut, o.flux_cut),
        ] {
            *mean += (new - *mean) * share;
        }
    }
}

/// Seconds of one stage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageTime {
    /// Its name.
    pub stage: &'static str,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// Everything a run tells about itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Rays by kind.
    pub rays: RayCounts,
    /// The global photon map.
    pub global_photons: PhotonCounts,
    /// The caustic photon map.
    pub caustic_photons: PhotonCounts,
    /// Stages in the order they ran.
    pub stages: Vec<StageTime>,
    /// Camera samples per pixel: fewest and most.
    pub samples_per_pixel: (u32, u32),
    /// Pixel sums that were not finite and were left out; above zero is a bug.
    pub rejected_pixels: u64,
    /// The first of them: column and row.
    pub first_rejected_pixel: Option<[u32; 2]>,
    /// Name and version of the ray tracing backend.
    pub accelerator: String,
    /// Bytes held by the ray tracing backend.
    pub accelerator_bytes: u64,
    /// Largest resident size of the process in bytes, where the system tells it.
    pub peak_memory_bytes: Option<u64>,
    /// Estimated relative mean squared error, if passes were kept apart.
    pub estimated_error: Option<f64>,
}

/// Largest resident size of this process so far, in bytes (Linux: `VmHWM`).
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

/// Lets [`peak_memory`] begin anew from what is resident now, where the system can (Linux).
pub fn reset_peak_memory() {
    // Where it cannot be, the peak is that of the whole process.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Processor time of this process so far, all threads together, in seconds, to the nanosecond.
#[cfg(unix)]
pub fn cpu_seconds() -> Option<f64> {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9)
}

/// Processor time of this process, where it is known: not here.
#[cfg(not(unix))]
pub fn cpu_seconds() -> Option<f64> {
    None
}
