-- See the SQLite file. Programs that know nothing of snapshots go on from the first part.
CREATE TABLE precut.process_snapshots (
    process  text   NOT NULL,
    number   bigint NOT NULL,
    sequence bigint NOT NULL,
    content  text   NOT NULL,
    PRIMARY KEY (process, number)
);
INSERT INTO precut.versions VALUES (13, 9);
