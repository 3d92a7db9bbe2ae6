-- Parts of jobs are kept, too. SQLite changes no rule of a column: the table is written anew.
CREATE TABLE documents_with_parts (
    kind       TEXT    NOT NULL CHECK (kind IN ('model', 'machine', 'tool', 'material', 'part')),
    name       TEXT    NOT NULL,
    revision   INTEGER NOT NULL CHECK (revision >= 1),
    -- What lists are filtered by: the calculator of a model, the kind of a machine or a tool, the group of a material, the
    -- field of a part.
    class      TEXT    NOT NULL,
    -- What is searched besides the name, a line each: title and other names.
    words      TEXT    NOT NULL DEFAULT '',
    sha256     TEXT    NOT NULL CHECK (length(sha256) = 64),
    created_ms INTEGER NOT NULL,
    -- For whom it counts; empty for nobody.
    owner      TEXT    NOT NULL DEFAULT '',
    bytes      INTEGER NOT NULL DEFAULT 0,
    -- JSON; NULL once deleted. Behind the rest, which lists read without it.
    content    TEXT    CHECK (content IS NULL OR json_valid(content)),
    PRIMARY KEY (kind, name, revision)
) STRICT;
INSERT INTO documents_with_parts SELECT kind, name, revision, class, words, sha256, created_ms, owner, bytes, content FROM documents;
DROP TABLE documents;
ALTER TABLE documents_with_parts RENAME TO documents;
CREATE INDEX documents_use ON documents (owner, kind, bytes) WHERE content IS NOT NULL;
