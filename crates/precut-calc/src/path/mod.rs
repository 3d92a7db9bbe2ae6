//! Tool paths as polylines.
