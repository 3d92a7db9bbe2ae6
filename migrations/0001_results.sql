-- Answers by the hash of what they depend on. `input` and `body` are zstd; `checksum` is BLAKE3 over everything else
-- that cannot be computed again from the row; `bytes` is what the row holds of the disk.
CREATE TABLE results (
    key        BLOB    NOT NULL PRIMARY KEY CHECK (length(key) = 32),
    calculator TEXT    NOT NULL,
    version    INTEGER NOT NULL,
    engine     TEXT    NOT NULL,
    input      BLOB    NOT NULL,
    body       BLOB    NOT NULL,
    checksum   BLOB    NOT NULL CHECK (length(checksum) = 32),
    bytes      INTEGER NOT NULL,
    created_ms INTEGER NOT NULL,
    used_ms    INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- Covers eviction (oldest use first, total size) and the list of keys, so that neither reads bodies.
CREATE INDEX results_by_use ON results (used_ms, bytes);
-- Cover the list, newest first.
CREATE INDEX results_by_time ON results (created_ms, key, calculator, version, engine, bytes);
CREATE INDEX results_by_calculator ON results (calculator, created_ms, key, version, engine, bytes);
