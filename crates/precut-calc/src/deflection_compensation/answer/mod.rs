//! What is answered: output, advice, pictures, program.

pub(super) mod advice;
pub(super) mod aimed;
pub(super) mod auto;
pub(super) mod columns;
pub(super) mod driven;
pub(super) mod fan;
pub(super) mod other_cuts;
pub(super) mod output;
pub(super) mod picture;
pub(super) mod toolpath;
