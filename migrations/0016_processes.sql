-- Processes under watch are documents, too. SQLite changes no rule of a column: the table is written anew.
CREATE TABLE documents_with_processes (
    kind       TEXT    NOT NULL CHECK (kind IN ('model', 'machine', 'tool', 'material', 'part', 'process')),
    name       TEXT    NOT NULL,
    revision   INTEGER NOT NULL CHECK (revision >= 1),
    -- What lists are filtered by: the calculator of a model or a process, the kind of a machine or a tool, the group of a
    -- material, the field of a part.
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
INSERT INTO documents_with_processes SELECT kind, name, revision, class, words, sha256, created_ms, owner, bytes, content FROM documents;
DROP TABLE documents;
ALTER TABLE documents_with_processes RENAME TO documents;
CREATE INDEX documents_use ON documents (owner, kind, bytes) WHERE content IS NOT NULL;

-- How far a process is. Whoever adds to its record says which sequence he saw: one after the other.
CREATE TABLE processes (
    name     TEXT    NOT NULL PRIMARY KEY,
    sequence INTEGER NOT NULL,
    -- What was said last, JSON.
    state    TEXT    CHECK (state IS NULL OR json_valid(state))
) STRICT;
-- All that happened to it, in order, without a gap: revisions of its document, parts, corrections, withdrawals, decisions,
-- paths. Nothing of it ever changes.
CREATE TABLE process_entries (
    process    TEXT    NOT NULL,
    sequence   INTEGER NOT NULL,
    kind       TEXT    NOT NULL CHECK (kind IN ('document', 'part', 'withdrawn', 'decision', 'path')),
    -- Of parts; a correction is the next revision.
    part       TEXT,
    revision   INTEGER NOT NULL,
    number     INTEGER,
    created_ms INTEGER NOT NULL,
    owner      TEXT    NOT NULL,
    bytes      INTEGER NOT NULL,
    -- What came, and what was said then: JSON.
    content    TEXT    NOT NULL CHECK (json_valid(content)),
    said       TEXT    NOT NULL CHECK (json_valid(said)),
    PRIMARY KEY (process, sequence)
) STRICT;
CREATE INDEX process_entries_of_part ON process_entries (process, part, sequence) WHERE part IS NOT NULL;
CREATE INDEX process_entries_use ON process_entries (owner, bytes);
-- Each part as it is now.
CREATE TABLE process_parts (
    process  TEXT    NOT NULL,
    part     TEXT    NOT NULL,
    -- NULL of one that was withdrawn.
    number   INTEGER,
    -- Of its last entry.
    sequence INTEGER NOT NULL,
    -- What is said of it now, JSON.
    now      TEXT    NOT NULL CHECK (json_valid(now)),
    PRIMARY KEY (process, part),
    UNIQUE (process, number)
) STRICT;

-- Who is told of a process: callbacks have numbers of their own, and are about a job or about an entry of a record.
DROP TRIGGER callbacks_of_what_is_over;
CREATE TABLE callbacks_of_all (
    id         INTEGER NOT NULL PRIMARY KEY,
    job        TEXT    UNIQUE REFERENCES precut_jobs (id) ON DELETE CASCADE,
    process    TEXT    CHECK ((process IS NULL) = (job IS NOT NULL)),
    sequence   INTEGER CHECK ((sequence IS NULL) = (process IS NULL)),
    url        TEXT    NOT NULL,
    -- Host and port of the address: none of them takes the places of all others.
    host       TEXT    NOT NULL,
    -- waiting: the job is not over; pending: it is to be told.
    state      TEXT    NOT NULL CHECK (state IN ('waiting', 'pending', 'delivered', 'given_up')),
    -- Tries begun.
    attempts   INTEGER NOT NULL DEFAULT 0,
    -- When it is tried next; while somebody tries, when he is taken for dead.
    next_ms    INTEGER CHECK ((next_ms IS NOT NULL) = (state = 'pending')),
    -- Who tries: only he can write what came of it.
    lease      TEXT,
    -- Why the last try came to nothing: a code.
    fault      TEXT,
    -- When it was delivered or given up.
    settled_ms INTEGER,
    UNIQUE (process, sequence)
) STRICT;
INSERT INTO callbacks_of_all (job, url, host, state, attempts, next_ms, lease, fault, settled_ms)
    SELECT job, url, host, state, attempts, next_ms, lease, fault, settled_ms FROM callbacks;
DROP TABLE callbacks;
ALTER TABLE callbacks_of_all RENAME TO callbacks;
CREATE INDEX callbacks_due ON callbacks (next_ms) WHERE state = 'pending';
CREATE TRIGGER callbacks_of_what_is_over AFTER UPDATE OF state ON precut_jobs
WHEN NEW.state IN ('succeeded', 'failed', 'cancelled') BEGIN
    UPDATE callbacks SET state = 'pending', next_ms = coalesce(NEW.finished_ms, 0) WHERE job = NEW.id AND state = 'waiting';
END;
