//! The tables' history as files in the program. Read here and not by the library's macro: that would build both drivers, SQLite
//! itself among them, a second time for the compiler's own use.

use rust_embed::RustEmbed;
use sqlx::SqlSafeStr as _;
use sqlx::migrate::{Migration, MigrationType, Migrator};

/// The migrations of a folder: `0001_what_it_does.sql`.
pub(super) fn embedded<Files: RustEmbed>() -> Migrator {
    let of = |name: &str| {
        let (version, what) = name.strip_suffix(".sql")?.split_once('_')?;
        let file = Files::get(name)?;
        let sql = String::from_utf8_lossy(&file.data).into_owned();
        let what = what.replace('_', " ").into();
        Some(Migration::new(
            version.parse().ok()?,
            what,
            MigrationType::Simple,
            sqlx::AssertSqlSafe(sql).into_sql_str(),
            false,
        ))
    };
    Migrator::with_migrations(Files::iter().filter_map(|name| of(&name)).collect())
}

/// Reads a struct from the columns of a row of either database that are called as its fields; `as` says as what a number is
/// kept.
macro_rules! from_row {
    (@column $row:ident, $field:ident) => {
        sqlx::Row::try_get($row, stringify!($field))?
    };
    (@column $row:ident, $field:ident as $kept:ty) => {
        sqlx::Row::try_get::<$kept, _>($row, stringify!($field))?.try_into().map_err(|error| sqlx::Error::Decode(Box::new(error)))?
    };
    (@of $row:ty, $name:ident { $($field:ident $(as $kept:ty)?),* }) => {
        impl<'r> sqlx::FromRow<'r, $row> for $name {
            fn from_row(row: &'r $row) -> Result<Self, sqlx::Error> {
                Ok(Self { $($field: from_row!(@column row, $field $(as $kept)?)),* })
            }
        }
    };
    ($name:ident { $($field:ident $(as $kept:ty)?),* $(,)? }) => {
        from_row!(@of sqlx::sqlite::SqliteRow, $name { $($field $(as $kept)?),* });
        from_row!(@of sqlx::postgres::PgRow, $name { $($field $(as $kept)?),* });
    };
}
