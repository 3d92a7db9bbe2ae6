//! Copies of the SQLite file: taken while a service runs, checked, and put back.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use futures_util::TryStreamExt;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{ConnectOptions, Connection};

use super::row::ResultRow;
use super::sqlite::{BUSY_TIMEOUT, DATABASE, lock};

/// What the name of a copy's checksum ends with.
const SUM: &str = "b3";

/// Why there is no copy, or it is none to rely on.
#[derive(Debug, thiserror::Error)]
pub enum BackupError {
    /// A file cannot be read or written.
    #[error("{file}: {why}", file = .0.display(), why = .1)]
    File(PathBuf, io::Error),
    /// Something is there already.
    #[error("{file} is there already; nothing is overwritten", file = .0.display())]
    There(PathBuf),
    /// The folder is in use, or cannot be used.
    #[error(transparent)]
    Folder(#[from] super::OpenError),
    /// The database does not serve.
    #[error("{file}: {why}", file = .0.display(), why = .1)]
    Database(PathBuf, sqlx::Error),
    /// The copy is not what was written.
    #[error("{file}: {why}", file = .0.display(), why = .1)]
    Damaged(PathBuf, String),
}

/// What a copy holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Contents {
    /// Jobs on record.
    pub jobs: u64,
    /// Kept results, each with the checksum that it was written with.
    pub results: u64,
    /// Revisions of stored models, machines, tools and materials.
    pub documents: u64,
    /// Size of the file, bytes.
    pub bytes: u64,
}

/// Copies the database in `folder` as it is at one moment, whoever works with it meanwhile, to a file that is not there
/// yet, and its checksum beside it.
pub async fn backup(folder: &Path, to: &Path) -> Result<Contents, BackupError> {
    for new in [to.to_owned(), sum_of(to)] {
        if new.exists() {
            return Err(BackupError::There(new));
        }
    }
    let from = folder.join(DATABASE);
    let failed = |error| BackupError::Database(from.clone(), error);
    let mut database = opened(&from).await?;
    // The name is of the next step until all of it is on the disk.
    let begun = to.with_extension("part");
    if begun.exists() {
        return Err(BackupError::There(begun));
    }
    let name = begun.to_string_lossy().into_owned();
    let copied = sqlx::query("VACUUM INTO ?1").bind(name).execute(&mut database).await;
    if let Err(error) = copied {
        let _ = fs::remove_file(&begun);
        return Err(failed(error));
    }
    database.close().await.map_err(failed)?;
    let sum = sum(&begun)?;
    let at = |path: &Path| {
        let path = path.to_owned();
        move |error| BackupError::File(path, error)
    };
    File::open(&begun).and_then(|file| file.sync_all()).map_err(at(&begun))?;
    fs::write(sum_of(to), format!("{sum}\n")).map_err(at(&sum_of(to)))?;
    fs::rename(&begun, to).map_err(at(to))?;
    verify(to).await
}

/// Reads every byte of a copy: its checksum, the structure of the database, the checksum of every result.
pub async fn verify(copy: &Path) -> Result<Contents, BackupError> {
    let damaged = |reason: String| BackupError::Damaged(copy.to_owned(), reason);
    let beside = sum_of(copy);
    let written = fs::read_to_string(&beside).map_err(|error| BackupError::File(beside, error))?;
    if sum(copy)? != written.trim() {
        return Err(damaged("its bytes are not those that were written (the checksum differs)".to_owned()));
    }
    let failed = |error| BackupError::Database(copy.to_owned(), error);
    let mut database = opened(copy).await?;
    let said: Vec<String> =
        sqlx::query_scalar("PRAGMA integrity_check").fetch_all(&mut database).await.map_err(failed)?;
    if said != ["ok"] {
        return Err(damaged(said.join("; ")));
    }
    let (mut results, mut bad) = (0, 0_u64);
    {
        let mut rows = sqlx::query_as::<_, ResultRow>(
            "SELECT key, calculator, version, engine, input, body, checksum, '' AS records FROM results",
        )
        .fetch(&mut database);
        while let Some(row) = rows.try_next().await.map_err(failed)? {
            results += 1;
            bad += u64::from(row.result().is_none());
        }
    }
    if bad > 0 {
        return Err(damaged(format!("{bad} of {results} results are damaged")));
    }
    // A copy may be older than the names of its tables.
    let has_jobs = "SELECT count(*) FROM sqlite_master WHERE name = 'jobs'";
    let count_jobs = match count(&mut database, has_jobs).await.map_err(failed)? {
        0 => "SELECT count(*) FROM precut_jobs",
        _ => "SELECT count(*) FROM jobs",
    };
    let jobs = count(&mut database, count_jobs).await.map_err(failed)?;
    let has_models = "SELECT count(*) FROM sqlite_master WHERE name = 'models'";
    let count_documents = match count(&mut database, has_models).await.map_err(failed)? {
        0 => "SELECT count(*) FROM documents",
        _ => "SELECT count(*) FROM models",
    };
    let documents = count(&mut database, count_documents).await.map_err(failed)?;
    database.close().await.map_err(failed)?;
    let bytes = fs::metadata(copy).map_err(|error| BackupError::File(copy.to_owned(), error))?.len();
    Ok(Contents { jobs, results, documents, bytes })
}

/// Puts a copy that is in order into a folder that has no database and that nobody uses.
pub async fn restore(copy: &Path, folder: &Path) -> Result<Contents, BackupError> {
    let contents = verify(copy).await?;
    let at = |path: &Path| {
        let path = path.to_owned();
        move |error| BackupError::File(path, error)
    };
    fs::create_dir_all(folder).map_err(at(folder))?;
    let _lock = lock(folder)?;
    let to = folder.join(DATABASE);
    for there in [to.clone(), folder.join(format!("{DATABASE}-wal"))] {
        if there.exists() {
            return Err(BackupError::There(there));
        }
    }
    let begun = folder.join(format!("{DATABASE}.part"));
    fs::copy(copy, &begun).map_err(at(&begun))?;
    File::open(&begun).and_then(|file| file.sync_all()).map_err(at(&begun))?;
    fs::rename(&begun, &to).map_err(at(&to))?;
    Ok(contents)
}

async fn opened(file: &Path) -> Result<SqliteConnection, BackupError> {
    let options = SqliteConnectOptions::new().filename(file).create_if_missing(false).busy_timeout(BUSY_TIMEOUT);
    options.connect().await.map_err(|error| BackupError::Database(file.to_owned(), error))
}

async fn count(database: &mut SqliteConnection, what: &'static str) -> Result<u64, sqlx::Error> {
    let count: i64 = sqlx::query_scalar(what).fetch_one(database).await?;
    Ok(u64::try_from(count).unwrap_or(0))
}

fn sum_of(copy: &Path) -> PathBuf {
    let mut name = copy.as_os_str().to_owned();
    name.push(".");
    name.push(SUM);
    name.into()
}

fn sum(file: &Path) -> Result<String, BackupError> {
    let failed = |error| BackupError::File(file.to_owned(), error);
    let mut hasher = blake3::Hasher::new();
    let mut opened = File::open(file).map_err(failed)?;
    let mut piece = vec![0; 1 << 20];
    loop {
        let count = io::Read::read(&mut opened, &mut piece).map_err(failed)?;
        if count == 0 {
            return Ok(hasher.finalize().to_hex().to_string());
        }
        hasher.update(&piece[..count]);
    }
}
