-- What the systems on a trace's way say of it: see the SQLite file.
ALTER TABLE precut.jobs ADD COLUMN tracestate text;
INSERT INTO precut.versions VALUES (6, 1);
