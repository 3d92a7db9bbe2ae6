-- Stored models, machines, tools and materials are documents of one sort: a name that belongs to somebody, in revisions that
-- never change. A deleted one leaves its last number, so that no later one of its name takes a number that results already
-- cite.
CREATE TABLE documents (
    kind       TEXT    NOT NULL CHECK (kind IN ('model', 'machine', 'tool', 'material')),
    name       TEXT    NOT NULL,
    revision   INTEGER NOT NULL CHECK (revision >= 1),
    -- What lists are filtered by: the calculator of a model, the kind of a machine or a tool, the group of a material.
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
INSERT INTO documents (kind, name, revision, class, sha256, created_ms, owner, bytes, content)
SELECT 'model', name, revision, calculator, sha256, created_ms, owner, bytes, content FROM models;
DROP TABLE models;
CREATE INDEX documents_use ON documents (owner, kind, bytes) WHERE content IS NOT NULL;
