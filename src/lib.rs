//! Dualight.
#![deny(unsafe_code)]
