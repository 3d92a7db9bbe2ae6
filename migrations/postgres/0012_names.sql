-- Names are in the order of their bytes, as in the SQLite file, so that one statement lists them in both. The view was there
-- for programs before 7, which this database serves no more since 9.
DROP VIEW IF EXISTS precut.models;
ALTER TABLE precut.documents ALTER COLUMN name TYPE text COLLATE "C";
INSERT INTO precut.versions VALUES (12, 9);
