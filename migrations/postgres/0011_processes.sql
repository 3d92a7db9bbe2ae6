-- Processes under watch: see the SQLite file.
ALTER TABLE precut.documents
    DROP CONSTRAINT documents_kind_check,
    ADD CONSTRAINT documents_kind_check CHECK (kind IN ('model', 'machine', 'tool', 'material', 'part', 'process'));
CREATE TABLE precut.processes (
    name     text   NOT NULL PRIMARY KEY,
    sequence bigint NOT NULL,
    state    text
);
CREATE TABLE precut.process_entries (
    process    text    NOT NULL,
    sequence   bigint  NOT NULL,
    kind       text    NOT NULL CHECK (kind IN ('document', 'part', 'withdrawn', 'decision', 'path')),
    part       text,
    revision   integer NOT NULL,
    number     bigint,
    created_ms bigint  NOT NULL,
    owner      text    NOT NULL,
    bytes      bigint  NOT NULL,
    content    text    NOT NULL,
    said       text    NOT NULL,
    PRIMARY KEY (process, sequence)
);
CREATE INDEX process_entries_of_part ON precut.process_entries (process, part, sequence) WHERE part IS NOT NULL;
CREATE INDEX process_entries_use ON precut.process_entries (owner) INCLUDE (bytes);
CREATE TABLE precut.process_parts (
    process  text   NOT NULL,
    part     text   NOT NULL,
    number   bigint,
    sequence bigint NOT NULL,
    now      text   NOT NULL,
    PRIMARY KEY (process, part),
    UNIQUE (process, number)
);
-- Who is told of a process: see the SQLite file. Programs that know nothing of it pass what is told of processes over.
ALTER TABLE precut.callbacks DROP CONSTRAINT callbacks_pkey;
ALTER TABLE precut.callbacks
    ALTER COLUMN job DROP NOT NULL,
    ADD UNIQUE (job),
    ADD COLUMN id bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    ADD COLUMN process text,
    ADD COLUMN sequence bigint,
    ADD UNIQUE (process, sequence),
    ADD CHECK ((process IS NULL) = (job IS NOT NULL)),
    ADD CHECK ((sequence IS NULL) = (process IS NULL));
INSERT INTO precut.versions VALUES (11, 9);
