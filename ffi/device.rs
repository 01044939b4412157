//! A device: Embree's settings, its worker threads, its errors and its memory count.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fmt;
use std::ptr::{self, NonNull};
use std::sync::{Arc, Mutex, PoisonError};

use embree4_sys::{RTCDevice, RTCDeviceProperty, RTCDeviceTy};

use super::shim;

/// What went wrong in Embree.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("Embree: {message} ({code})")]
#[non_exhaustive]
pub struct EmbreeError {
    /// The kind of error.
    pub code: ErrorCode,
    /// The text of Embree, or of the check before it.
    pub message: String,
}

impl EmbreeError {
    /// An error found before Embree was asked.
    pub(super) fn new(code: ErrorCode, message: impl Into<String>) -> Self {
        Self {
            code,
            message: message.into(),
        }
    }

    /// An argument Embree must not see.
    pub(super) fn argument(message: impl Into<String>) -> Self {
        Self::new(ErrorCode::InvalidArgument, message)
    }
}

/// The kinds of error Embree knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorCode {
    /// Embree does not say.
    Unknown,
    /// An argument is out of its domain.
    InvalidArgument,
    /// The object cannot do that, or not now.
    InvalidOperation,
    /// Not enough memory.
    OutOfMemory,
    /// The processor lacks instructions Embree needs.
    UnsupportedCpu,
    /// A callback cancelled the operation.
    Cancelled,
    /// Any other code, as Embree numbers it.
    Other(i32),
}

impl From<c_int> for ErrorCode {
    fn from(code: c_int) -> Self {
        match code {
            1 => Self::Unknown,
            2 => Self::InvalidArgument,
            3 => Self::InvalidOperation,
            4 => Self::OutOfMemory,
            5 => Self::UnsupportedCpu,
            6 => Self::Cancelled,
            other => Self::Other(other),
        }
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown => f.write_str("unknown error"),
            Self::InvalidArgument => f.write_str("invalid argument"),
            Self::InvalidOperation => f.write_str("invalid operation"),
            Self::OutOfMemory => f.write_str("out of memory"),
            Self::UnsupportedCpu => f.write_str("unsupported processor"),
            Self::Cancelled => f.write_str("cancelled"),
            Self::Other(code) => write!(f, "error {code}"),
        }
    }
}

/// The memory Embree holds for a device: geometry buffers and hierarchies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryUse {
    /// Bytes now.
    pub current: u64,
    /// Bytes at most so far.
    pub peak: u64,
}

/// An open Embree device. Clones are handles to the same one.
///
/// It is closed when the last handle, geometry and scene of it are gone.
#[derive(Clone, Debug)]
pub struct Device {
    handle: Arc<Handle>,
}

/// Owns the device and its monitor.
#[derive(Debug)]
struct Handle {
    device: NonNull<RTCDeviceTy>,
    monitor: Monitor,
    /// Held while building, so that an error found belongs to the call just made.
    building: Mutex<()>,
}

// SAFETY: both pointers are owned by this handle alone. Embree allows calls on a device
// from any thread, and the monitor locks what it keeps (shim.c).
unsafe impl Send for Handle {}
// SAFETY: as above; `&Handle` gives out nothing but those calls.
unsafe impl Sync for Handle {}

/// Owns the error slot and memory count of a device.
#[derive(Debug)]
struct Monitor(NonNull<shim::dualight_monitor>);

impl Drop for Monitor {
    fn drop(&mut self) {
        // SAFETY: the pointer comes from `dualight_monitor_new` and is freed only here.
        // The device that calls into it is gone: its handle releases it first.
        unsafe { shim::dualight_monitor_free(self.0.as_ptr()) }
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: the pointer comes from `rtcNewDevice` and is released only here. Every
        // geometry and scene holds an `Arc` of this handle, so they were released before;
        // this is the last reference and Embree tears the device down now, while the
        // monitor, a field dropped after this function, is still there.
        unsafe { embree4_sys::rtcReleaseDevice(self.device.as_ptr()) }
    }
}

impl Device {
    /// Opens a device.
    ///
    /// `config` is Embree's list of settings such as `"threads=2,isa=avx2"`; empty means
    /// all of Embree's defaults. Embree ignores names it does not know.
    ///
    /// # Errors
    ///
    /// If Embree does not take the settings or the processor, is not version 4, or was
    /// built without triangles, points or filter functions.
    pub fn new(config: &str) -> Result<Self, EmbreeError> {
        let setting = CString::new(config)
            .map_err(|_| EmbreeError::argument("the device configuration contains a zero byte"))?;

        // SAFETY: takes nothing; the result is checked.
        let monitor = NonNull::new(unsafe { shim::dualight_monitor_new() }).map(Monitor);
        let monitor = monitor
            .ok_or_else(|| EmbreeError::new(ErrorCode::OutOfMemory, "no memory for a device"))?;

        let mut device: *mut c_void = ptr::null_mut();
        // SAFETY: `setting` ends with zero and is only read during the call; `monitor` is
        // valid and outlives the device (see `Handle`); `device` is ours to write.
        let code = unsafe {
            shim::dualight_device_open(setting.as_ptr(), monitor.0.as_ptr(), &raw mut device)
        };
        let device = NonNull::new(device.cast::<RTCDeviceTy>()).ok_or_else(|| {
            EmbreeError::new(
                code.into(),
                format!("cannot open a device with the configuration \"{config}\""),
            )
        })?;

        let device = Self {
            handle: Arc::new(Handle {
                device,
                monitor,
                building: Mutex::new(()),
            }),
        };
        device.check_abilities()?;
        Ok(device)
    }

    /// The version of the Embree library, as major, minor, patch.
    #[must_use]
    pub fn version(&self) -> [u32; 3] {
        [
            RTCDeviceProperty::VERSION_MAJOR,
            RTCDeviceProperty::VERSION_MINOR,
            RTCDeviceProperty::VERSION_PATCH,
        ]
        .map(|property| u32::try_from(self.property(property)).unwrap_or(0))
    }

    /// The memory this device holds now and held at most.
    #[must_use]
    pub fn memory(&self) -> MemoryUse {
        let (mut current, mut peak) = (0, 0);
        // SAFETY: the monitor is valid as long as the handle, its counters are atomic, and
        // both results are ours to write.
        unsafe {
            shim::dualight_monitor_memory(
                self.handle.monitor.0.as_ptr(),
                &raw mut current,
                &raw mut peak,
            );
        }
        // Not below zero in sum, but a thread may see a release before its allocation.
        let bytes = |count: i64| u64::try_from(count).unwrap_or(0);
        MemoryUse {
            current: bytes(current),
            peak: bytes(peak),
        }
    }

    /// The device for Embree's functions; valid while `self` lives.
    pub(super) fn raw(&self) -> RTCDevice {
        self.handle.device.as_ptr()
    }

    /// Whether both are handles to one device.
    pub(super) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.handle, &other.handle)
    }

    /// Makes calls that build or change something, and asks whether they failed.
    ///
    /// One thread at a time per device: so objects are never changed from two threads, and
    /// an error is that of these calls. `calls` must not come here again.
    pub(super) fn build<T>(&self, calls: impl FnOnce() -> T) -> Result<T, EmbreeError> {
        let _one_at_a_time = self
            .handle
            .building
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        // What a query or a release left behind is not ours.
        drop(self.take_error());
        let result = calls();
        self.take_error().map_or(Ok(result), Err)
    }

    /// The first error since the last take.
    fn take_error(&self) -> Option<EmbreeError> {
        let mut text: [c_char; 512] = [0; 512];
        // SAFETY: the monitor is valid as long as the handle and locks itself; `text` is
        // ours to write, with its length.
        let code = unsafe {
            shim::dualight_monitor_take_error(
                self.handle.monitor.0.as_ptr(),
                text.as_mut_ptr(),
                text.len(),
            )
        };
        if code == 0 {
            return None;
        }
        // SAFETY: the call ended the text with zero inside the array, which outlives the
        // borrow.
        let message = unsafe { CStr::from_ptr(text.as_ptr()) }.to_string_lossy();
        Some(EmbreeError::new(code.into(), message))
    }

    /// Stops with an error what this crate cannot work with.
    fn check_abilities(&self) -> Result<(), EmbreeError> {
        let [major, minor, patch] = self.version();
        if major != 4 {
            let message =
                format!("found Embree {major}.{minor}.{patch}, but Dualight needs Embree 4");
            return Err(EmbreeError::new(ErrorCode::InvalidOperation, message));
        }
        let needed = [
            (RTCDeviceProperty::TRIANGLE_GEOMETRY_SUPPORTED, "triangles"),
            (RTCDeviceProperty::POINT_GEOMETRY_SUPPORTED, "points"),
            (
                RTCDeviceProperty::FILTER_FUNCTION_SUPPORTED,
                "filter functions",
            ),
        ];
        let lacking: Vec<&str> = needed
            .iter()
            .filter(|(property, _)| self.property(*property) == 0)
            .map(|(_, name)| *name)
            .collect();
        if lacking.is_empty() {
            return Ok(());
        }
        let message = format!(
            "this Embree {major}.{minor}.{patch} was built without {}",
            lacking.join(", ")
        );
        Err(EmbreeError::new(ErrorCode::InvalidOperation, message))
    }

    /// A number Embree tells about itself.
    fn property(&self, property: RTCDeviceProperty) -> isize {
        // SAFETY: the device is valid while `self` lives; reading is allowed on any thread.
        unsafe { embree4_sys::rtcGetDeviceProperty(self.raw(), property) }
    }
}
