//! Feed scheduling: its room holds the fit of machinability models.

pub mod fit;
