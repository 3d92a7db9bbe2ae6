-- Models that a diagnosis made, by name: each change is a revision of its own, which never changes. A deleted model
-- leaves its last number, so that no later one of its name takes a number that results already cite.
CREATE TABLE models (
    name       TEXT    NOT NULL,
    revision   INTEGER NOT NULL CHECK (revision >= 1),
    calculator TEXT    NOT NULL,
    -- JSON; NULL once deleted.
    content    TEXT    CHECK (content IS NULL OR json_valid(content)),
    sha256     TEXT    NOT NULL CHECK (length(sha256) = 64),
    created_ms INTEGER NOT NULL,
    PRIMARY KEY (name, revision)
) STRICT, WITHOUT ROWID;
