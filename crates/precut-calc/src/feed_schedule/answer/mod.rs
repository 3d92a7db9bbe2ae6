//! What is answered: output, advice, pictures, program.

pub(super) mod advice;
pub(super) mod driven;
pub(super) mod output;
pub(super) mod picture;
pub(super) mod run;
pub(super) mod toolpath;
pub(super) mod words;
