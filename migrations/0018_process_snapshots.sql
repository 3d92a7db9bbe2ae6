-- Processes as they were after some of their parts, the last few: they are computed again from there, not from the first part.
-- Nothing is lost with them.
CREATE TABLE process_snapshots (
    process  TEXT    NOT NULL,
    -- Of the part.
    number   INTEGER NOT NULL,
    -- Of the last entry that it knows of.
    sequence INTEGER NOT NULL,
    -- JSON.
    content  TEXT    NOT NULL,
    PRIMARY KEY (process, number)
) STRICT;
