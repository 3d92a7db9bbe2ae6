//! Copies of the data folder's database: taken, checked, put back.

use std::path::PathBuf;

use clap::Args;

use super::{Failed, print};
use crate::store::backup::{BackupError, Contents, backup, restore, verify};

/// What is copied, and where to.
#[derive(Debug, Args)]
pub(super) struct CopyArgs {
    /// File of the copy; its checksum stands beside it in a file of that name with `.b3` behind it
    file: PathBuf,
    /// Folder of the database
    #[arg(long, value_name = "DIR", env = "PRECUT_DATA", default_value = "./data")]
    data: PathBuf,
}

/// What is checked.
#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// File of the copy
    file: PathBuf,
}

/// `precut backup`
pub(super) fn take(arguments: &CopyArgs) -> Result<(), Failed> {
    told("copied", run(backup(&arguments.data, &arguments.file))?)
}

/// `precut restore`
pub(super) fn put_back(arguments: &CopyArgs) -> Result<(), Failed> {
    told("restored", run(restore(&arguments.file, &arguments.data))?)
}

/// `precut verify`
pub(super) fn check(arguments: &VerifyArgs) -> Result<(), Failed> {
    told("in order", run(verify(&arguments.file))?)
}

fn run(work: impl Future<Output = Result<Contents, BackupError>>) -> Result<Contents, Failed> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| Failed::Machine(format!("the threads cannot be started: {error}")))?;
    runtime.block_on(work).map_err(|error| Failed::Machine(error.to_string()))
}

fn told(what: &str, contents: Contents) -> Result<(), Failed> {
    let Contents { jobs, results, documents, bytes } = contents;
    print(format!("{what}: {jobs} jobs, {results} results, {documents} revisions of models and library records, {bytes} bytes\n").as_bytes())
}
