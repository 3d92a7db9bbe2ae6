//! Connecting, and what may be wrong at the start. No word of it repeats the address: it may hold a password.

use std::borrow::Cow;
use std::str::FromStr;
use std::time::Duration;

use sqlx::Connection;
use sqlx::error::DatabaseError;
use sqlx::migrate::{MigrateError, Migrator};
use sqlx::postgres::{PgConnectOptions, PgPool, PgPoolOptions};
use tokio::time::Instant;

use super::{Use, tls};
use crate::store::OpenError;
use crate::store::address::Secret;

/// What this program knows of the tables: the number of its last migration.
pub(super) const SCHEMA: i32 = 14;
/// How long a request waits for a connection before it is told that the store does not serve; in tests, which share their
/// cores with many others, as long as that never says anything of them.
const ACQUIRE: Duration = Duration::from_secs(if cfg!(test) { 60 } else { 2 });
/// A connection that was idle for longer is asked whether it still is one.
const TRUSTED_IDLE: Duration = Duration::from_secs(1);
/// Between two attempts to reach a database at the start.
const PAUSE: Duration = Duration::from_millis(250);

#[derive(rust_embed::RustEmbed)]
#[folder = "migrations/postgres"]
struct Migrations;

pub(super) fn migrations() -> Migrator {
    let mut migrations = crate::store::migrations::embedded::<Migrations>();
    migrations.dangerous_set_table_name("precut._sqlx_migrations");
    migrations.create_schema("precut");
    // What a newer program has added is told by `precut.versions`.
    migrations.set_ignore_missing(true);
    migrations
}

/// Why the database cannot be used.
pub(super) fn refused(error: &sqlx::Error) -> OpenError {
    OpenError::Database(reason(error))
}

/// What is wrong, without credentials and without the address.
fn reason(error: &sqlx::Error) -> String {
    let code = error.as_database_error().and_then(DatabaseError::code).map(Cow::into_owned);
    match (error, code.as_deref()) {
        (_, Some("28P01")) => "it does not accept the user name or the password (user and password stand in the \
                               address, or in PGUSER and PGPASSWORD)"
            .to_owned(),
        (_, Some("3D000")) => "it has no database of that name; make one with `createdb`".to_owned(),
        (_, Some("42501")) => format!(
            "the user may not do what is needed ({}); he must own the database, or an administrator starts the program \
             once as its owner and grants him the schema `precut`",
            error.as_database_error().map_or("", |error| error.message())
        ),
        (_, Some("25006")) => "it is read-only: a standby, or set so".to_owned(),
        (_, Some("53100")) => "its disk is full".to_owned(),
        (_, Some("53300")) => "it has no connection to spare; raise its `max_connections` or lower \
                               `postgres.connections`"
            .to_owned(),
        (_, Some(code)) => {
            format!("{} ({code})", error.as_database_error().map_or("", |error| error.message()))
        }
        // These may quote what they could not read.
        (sqlx::Error::Configuration(_), _) => "the address is not understood; it reads \
                                               postgres://user:password@host:5432/database"
            .to_owned(),
        (sqlx::Error::Io(error), _) => format!("it does not answer ({error})"),
        (sqlx::Error::PoolTimedOut, _) => "it does not answer".to_owned(),
        (other, _) => other.to_string(),
    }
}

/// Whether waiting may help: nobody listens there yet, or it is just starting or stopping.
fn may_pass(error: &sqlx::Error) -> bool {
    match error {
        sqlx::Error::Io(error) => !tls::is_refusal(error),
        sqlx::Error::PoolTimedOut => true,
        other => other
            .as_database_error()
            .and_then(DatabaseError::code)
            .is_some_and(|code| matches!(code.as_ref(), "57P03" | "57P01" | "57P02" | "53300")),
    }
}

/// A pool of connections to a database whose tables are up to date.
pub(super) async fn connected(address: &Secret, usage: &Use) -> Result<PgPool, OpenError> {
    let options = PgConnectOptions::from_str(address.reveal()).map_err(|error| refused(&error))?;
    let options = tls::checked(options, address.reveal()).map_err(OpenError::Database)?.application_name("precut");
    // A connection of its own: to bring tables up to date may take longer than anything later.
    let first = patiently(&options, usage.patience.start).await?;
    let prepared = prepare(&first).await;
    first.close().await;
    prepared?;
    PgPoolOptions::new()
        // One more, for the notifications.
        .max_connections(usage.connections.saturating_add(1))
        .acquire_timeout(ACQUIRE)
        .test_before_acquire(false)
        .before_acquire(|connection, meta| {
            Box::pin(async move {
                if meta.idle_for > TRUSTED_IDLE {
                    connection.ping().await?;
                }
                Ok(true)
            })
        })
        .connect_with(options.options([
            // Tables are named as in the SQLite file.
            ("search_path", "precut"),
            // Whoever is stopped in the middle of a transaction lets the others go on.
            ("idle_in_transaction_session_timeout", "5s"),
            ("lock_timeout", "10s"),
            ("statement_timeout", "60s"),
            // A cable that was pulled is noticed by the database, too.
            ("tcp_keepalives_idle", "10"),
            ("tcp_keepalives_interval", "5"),
            ("tcp_keepalives_count", "3"),
        ]))
        .await
        .map_err(|error| refused(&error))
}

/// Why it lets nobody in.
fn closed(error: &sqlx::Error, options: &PgConnectOptions) -> OpenError {
    OpenError::Database(tls::reason(error, options).unwrap_or_else(|| reason(error)))
}

/// A connection, also to a database that is not up yet.
async fn patiently(options: &PgConnectOptions, most: Duration) -> Result<PgPool, OpenError> {
    let begun = Instant::now();
    let mut told = false;
    loop {
        // The pool itself goes on trying for as long as this.
        let single = PgPoolOptions::new().max_connections(1).acquire_timeout(PAUSE.max(most / 2).min(ACQUIRE));
        match single.connect_with(options.clone()).await {
            Ok(pool) => return Ok(pool),
            Err(error) if may_pass(&error) && begun.elapsed() < most => {
                if !told {
                    tracing::warn!(reason = reason(&error), wait_s = most.as_secs_f64(), "waiting for the database");
                    told = true;
                }
            }
            Err(error) => return Err(closed(&error, options)),
        }
        tokio::time::sleep(PAUSE).await;
    }
}

/// Brings the tables up to date, one process at a time. Where there is nothing to be done it needs
/// no right to make anything.
async fn prepare(pool: &PgPool) -> Result<(), OpenError> {
    let failed = |error: sqlx::Error| refused(&error);
    let (read_only, server): (String, i32) = sqlx::query_as(
        "SELECT current_setting('transaction_read_only'), current_setting('server_version_num')::integer",
    )
    .fetch_one(pool)
    .await
    .map_err(failed)?;
    if read_only == "on" {
        return Err(OpenError::Database("it is read-only: a standby, or set so".to_owned()));
    }
    if server < 130_000 {
        return Err(OpenError::Database(format!("PostgreSQL 13 or later is needed, this is {}", server / 10_000)));
    }
    if is_up_to_date(pool).await? {
        return Ok(());
    }
    migrations().run(pool).await.map_err(|error| migration_fault(&error))
}

/// Whether the tables are as this program knows them, or those of a newer one that serves it. Those of a newer one that
/// does not are an error.
async fn is_up_to_date(pool: &PgPool) -> Result<bool, OpenError> {
    let failed = |error: sqlx::Error| refused(&error);
    let there: bool = sqlx::query_scalar("SELECT to_regclass('precut.versions') IS NOT NULL")
        .fetch_one(pool)
        .await
        .map_err(failed)?;
    if !there {
        return Ok(false);
    }
    let (version, serves_from): (i32, i32) =
        sqlx::query_as("SELECT version, serves_from FROM precut.versions ORDER BY version DESC LIMIT 1")
            .fetch_one(pool)
            .await
            .map_err(failed)?;
    if version > SCHEMA && serves_from > SCHEMA {
        return Err(OpenError::Database(format!(
            "its tables were made by a newer precut (schema {version}; this program knows {SCHEMA})"
        )));
    }
    if version > SCHEMA {
        tracing::info!(
            schema = version,
            known = SCHEMA,
            "the tables are those of a newer precut, which serve this one"
        );
    }
    Ok(version >= SCHEMA)
}

fn migration_fault(error: &MigrateError) -> OpenError {
    match error {
        MigrateError::VersionMismatch(version) => {
            OpenError::Database(format!("its tables were not made by this program (migration {version} differs)"))
        }
        MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => refused(error),
        other => OpenError::Database(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_migration_is_the_schema_that_this_program_knows() {
        let latest = migrations().iter().map(|migration| migration.version).max();
        assert_eq!(latest, Some(i64::from(SCHEMA)));
    }
}
