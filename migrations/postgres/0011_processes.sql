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
INSERT INTO precut.versions VALUES (11, 9);
