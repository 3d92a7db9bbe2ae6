-- Results, jobs, parts of studies and timings of many processes. The tables are those of the SQLite file; what differs
-- is how several writers get along. Their schema `precut` is made before this; the queue keeps to its own, `apalis`.

-- Which program may work with this database: one that knows `serves_from` or later. A migration that old programs can
-- live with adds a row that still names an early one, so that old and new run side by side.
CREATE TABLE precut.versions (
    version     integer NOT NULL PRIMARY KEY,
    serves_from integer NOT NULL
);
INSERT INTO precut.versions VALUES (1, 1);

-- The one clock of all processes: theirs may differ by minutes. Milliseconds UTC.
CREATE FUNCTION precut.now_ms() RETURNS bigint LANGUAGE sql VOLATILE AS
    $$ SELECT (extract(epoch FROM clock_timestamp()) * 1000)::bigint $$;

-- Whoever changes who computes a key holds this lock of its transaction.
CREATE FUNCTION precut.lock_of(key bytea) RETURNS bigint LANGUAGE sql IMMUTABLE AS
    $$ SELECT ('x' || encode(substring(key FROM 1 FOR 8), 'hex'))::bit(64)::bigint $$;

CREATE TABLE precut.results (
    key        bytea   NOT NULL PRIMARY KEY CHECK (octet_length(key) = 32),
    calculator text    NOT NULL,
    version    integer NOT NULL,
    engine     text    NOT NULL,
    -- zstd; the checksum is BLAKE3 over everything else that cannot be computed again from the row.
    input      bytea   NOT NULL,
    body       bytea   NOT NULL,
    checksum   bytea   NOT NULL CHECK (octet_length(checksum) = 32),
    bytes      bigint  NOT NULL,
    created_ms bigint  NOT NULL,
    used_ms    bigint  NOT NULL
);
-- They are compressed already.
ALTER TABLE precut.results ALTER COLUMN input SET STORAGE EXTERNAL, ALTER COLUMN body SET STORAGE EXTERNAL;
CREATE INDEX results_by_use ON precut.results (used_ms, key) INCLUDE (bytes);
CREATE INDEX results_by_time ON precut.results (created_ms, key);
CREATE INDEX results_by_calculator ON precut.results (calculator, created_ms, key);

-- Room in the pages: progress is written every second, and no index knows of it.
CREATE TABLE precut.jobs (
    id           text COLLATE "C" NOT NULL PRIMARY KEY,
    kind         text    NOT NULL,
    calculator   text    NOT NULL,
    version      integer NOT NULL,
    -- Version of the program that accepted it: an earlier one need not be able to read it.
    engine       text    NOT NULL,
    key          bytea   NOT NULL CHECK (octet_length(key) = 32),
    input        bytea   NOT NULL,
    state        text    NOT NULL CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    stage        text,
    progress     double precision NOT NULL DEFAULT 0,
    attempt      integer NOT NULL DEFAULT 0,
    lease        text    CHECK ((lease IS NOT NULL) = (state = 'running')),
    heartbeat_ms bigint,
    priority     integer NOT NULL CHECK (priority BETWEEN 0 AND 2),
    turn         bigint  NOT NULL,
    pushed       integer NOT NULL DEFAULT 0,
    owner        text    NOT NULL,
    idempotency  text,
    body_hash    bytea   CHECK (body_hash IS NULL OR octet_length(body_hash) = 32),
    problem      text,
    estimate_ms  double precision NOT NULL,
    created_ms   bigint  NOT NULL,
    started_ms   bigint,
    finished_ms  bigint,
    deadline_ms  bigint,
    expires_ms   bigint,
    UNIQUE (owner, idempotency)
) WITH (fillfactor = 70, autovacuum_vacuum_scale_factor = 0.02);
ALTER TABLE precut.jobs ALTER COLUMN input SET STORAGE EXTERNAL;
CREATE INDEX jobs_by_state ON precut.jobs (state, id);
CREATE INDEX jobs_by_calculator ON precut.jobs (calculator, id);
CREATE INDEX jobs_open_by_key ON precut.jobs (key) WHERE state IN ('queued', 'running');
CREATE INDEX jobs_kept_by_key ON precut.jobs (key, expires_ms) WHERE state = 'succeeded';
CREATE INDEX jobs_by_lease ON precut.jobs (lease) WHERE lease IS NOT NULL;
CREATE INDEX jobs_in_line ON precut.jobs (priority, turn) WHERE state = 'queued';
CREATE INDEX jobs_of_owner ON precut.jobs (owner, priority, turn) WHERE state = 'queued';
CREATE INDEX jobs_by_deadline ON precut.jobs (deadline_ms)
    WHERE deadline_ms IS NOT NULL AND state IN ('queued', 'running');
CREATE INDEX jobs_by_expiry ON precut.jobs (expires_ms) WHERE expires_ms IS NOT NULL;

CREATE TABLE precut.timings (
    calculator   text    NOT NULL,
    version      integer NOT NULL,
    predicted_ms double precision NOT NULL,
    actual_ms    double precision NOT NULL,
    at_ms        bigint  NOT NULL
);
CREATE INDEX timings_by_time ON precut.timings (at_ms);

-- Studies that are being computed: which part nobody has taken yet.
CREATE TABLE precut.shared_studies (
    study      bytea   NOT NULL PRIMARY KEY CHECK (octet_length(study) = 32),
    next       integer NOT NULL DEFAULT 0,
    created_ms bigint  NOT NULL
) WITH (fillfactor = 50);

-- Their parts: taken by somebody (`holder`, who says every second that he lives), or done (`points`).
CREATE TABLE precut.studies (
    study      bytea   NOT NULL CHECK (octet_length(study) = 32),
    shard      integer NOT NULL,
    holder     text,
    beat_ms    bigint,
    points     bytea,
    checksum   bytea   CHECK (checksum IS NULL OR octet_length(checksum) = 32),
    created_ms bigint  NOT NULL,
    PRIMARY KEY (study, shard)
) WITH (fillfactor = 70);
ALTER TABLE precut.studies ALTER COLUMN points SET STORAGE EXTERNAL;
CREATE INDEX studies_by_time ON precut.studies (created_ms);
CREATE INDEX studies_held ON precut.studies (study, beat_ms) WHERE points IS NULL;

-- Models that a diagnosis made, by name: each change is a revision of its own, which never changes. A deleted model
-- leaves its last number, so that no later one of its name takes a number that results already cite.
CREATE TABLE precut.models (
    name       text    NOT NULL,
    revision   integer NOT NULL CHECK (revision >= 1),
    calculator text    NOT NULL,
    content    text,
    sha256     text    NOT NULL CHECK (length(sha256) = 64),
    created_ms bigint  NOT NULL,
    PRIMARY KEY (name, revision)
);
