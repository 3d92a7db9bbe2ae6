-- Results in the order in which they came, their large columns last. Under their keys, which are random, every new one
-- fell on another page, which was read and written again with the rows that it held already.
CREATE TABLE results_in_order (
    key        BLOB    NOT NULL UNIQUE CHECK (length(key) = 32),
    calculator TEXT    NOT NULL,
    version    INTEGER NOT NULL,
    engine     TEXT    NOT NULL,
    checksum   BLOB    NOT NULL CHECK (length(checksum) = 32),
    bytes      INTEGER NOT NULL,
    created_ms INTEGER NOT NULL,
    used_ms    INTEGER NOT NULL,
    input      BLOB    NOT NULL,
    body       BLOB    NOT NULL
) STRICT;
INSERT INTO results_in_order
    SELECT key, calculator, version, engine, checksum, bytes, created_ms, used_ms, input, body
    FROM results ORDER BY created_ms, key;
DROP TABLE results;
ALTER TABLE results_in_order RENAME TO results;

-- Covers eviction (oldest use first, total size) and the list of keys, so that neither reads bodies.
CREATE INDEX results_by_use ON results (used_ms, key, bytes);
-- Cover the list, newest first.
CREATE INDEX results_by_time ON results (created_ms, key, calculator, version, engine, bytes);
CREATE INDEX results_by_calculator ON results (calculator, created_ms, key, version, engine, bytes);
