-- Parts of parameter studies that are done while the study is not: a study that its process took along goes on from
-- here. A part follows from the study's key alone, so that it does not matter who wrote it, or how often.
CREATE TABLE studies (
    study      BLOB    NOT NULL CHECK (length(study) = 32),
    shard      INTEGER NOT NULL,
    -- zstd; the checksum is BLAKE3 of it.
    points     BLOB    NOT NULL,
    checksum   BLOB    NOT NULL CHECK (length(checksum) = 32),
    created_ms INTEGER NOT NULL,
    PRIMARY KEY (study, shard)
) STRICT, WITHOUT ROWID;
CREATE INDEX studies_by_time ON studies (created_ms);
