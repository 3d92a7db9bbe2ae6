// What an answer offers: handles that numbers of the job follow, numbers that buy something, better settings, and the sheet of
// the next measurement, which the door of the table reads back.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { settled, movedJob, stepOf, roomy } from '../../ui/app/handles.js';
import { knobsOf, chosenJob } from '../../ui/app/offers.js';
import { sheetOf, csvOf } from '../../ui/app/inspection.js';
import {
  readFile,
  rowFields,
  runsOf,
  wanted,
  freeOf,
  guess,
  conditionsIn,
  conditionsOf,
  runsWith,
  measuredOnly,
  othersOf,
  matched,
  joined,
  lastRun,
} from '../../ui/app/table-file.js';
import { resolve } from '../../ui/app/schema.js';

const number = (unit, title) => ({ type: 'number', 'x-unit': unit, title });

test('a handle goes by round numbers, stops where it shall, and stays within its reach', () => {
  const handle = {
    x: 400,
    along: 'x',
    reach: [10, 990],
    stops: [0, 500, 1000],
    moves: [
      { pointer: '/parts/0/length_mm', per_unit: 1 },
      { pointer: '/parts/1/length_mm', per_unit: -1 },
    ],
  };
  assert.equal(stepOf(2.4), 1);
  assert.equal(settled(handle, 433.7, 1), 434);
  assert.equal(settled(handle, 494.2, 1, 7), 500);
  assert.equal(settled(handle, 1200, 1), 990);
  const job = { parts: [{ length_mm: 400 }, { length_mm: 600 }] };
  assert.deepEqual(movedJob(job, job, handle, 34).parts, [{ length_mm: 434 }, { length_mm: 566 }]);
  // What the job leaves to the service begins where the service put it.
  const offset = { ...handle, moves: [{ pointer: '/rest/z_mm', per_unit: 1 }] };
  assert.deepEqual(movedJob(job, { rest: { z_mm: 5.25 } }, offset, 0.1).rest, { z_mm: 5.35 });
  assert.equal(movedJob(job, {}, offset, 1), job);
});

test('handles too near for a finger give way to those that come later', () => {
  const at = (x, y) => ({ handle: { x, y } });
  const same = value => value;
  assert.deepEqual(
    roomy([at(0, 0), at(10, 0), at(60, 0)], same, same, { top: -100, height: 200 }).map(({ handle }) => handle.x),
    [10, 60],
  );
});

test('a handle that goes along the axis makes way upwards or downwards while there is room', () => {
  const at = (x, along) => ({ handle: { x, y: 0, along } });
  const same = value => value;
  const places = (top, ...handles) => roomy(handles, same, same, { top, height: -2 * top }).map(({ h, v }) => [h, v]);
  assert.deepEqual(places(-100, at(0, 'x'), at(10, 'x')), [
    [0, -26],
    [10, 0],
  ]);
  // One that goes up and down stays where it says how far; in a low panel there is no way.
  assert.deepEqual(places(-100, at(0, 'y'), at(10, 'x')), [[10, 0]]);
  assert.deepEqual(places(-20, at(0, 'x'), at(10, 'x'))[0], [0, -26]);
  assert.deepEqual(places(-19, at(0, 'x'), at(10, 'x')), [[10, 0]]);
});

test('a knob gives way by one percent to the side on which it is looser', () => {
  const inputs = {
    type: 'object',
    properties: {
      zones: {
        type: 'array',
        items: { type: 'object', properties: { id: { type: 'string' }, most_um: number('um', 'deflection limit') } },
      },
      least: number('1', 'least feed'),
    },
  };
  const item = {
    type: 'object',
    properties: {
      pointer: { type: 'string' },
      gain: { type: ['number', 'null'], 'x-knobs': { pointer: 'pointer', looser: 'looser', gain: 'gain', of: '/objective' } },
    },
  };
  const outputs = { type: 'object', properties: { objective: number('min', 'objective'), prices: { type: 'array', items: item } } };
  const prices = [
    { pointer: '/zones/1/most_um', looser: 'more', gain: 0.4 },
    { pointer: '/least', looser: 'less', gain: 0.1 },
    { pointer: '/whole', looser: 'more' },
    { pointer: '/not/there', looser: 'more', gain: 1 },
  ];
  const found = knobsOf(
    { input_schema: inputs, output_schema: outputs },
    {
      input: {
        zones: [
          { id: 'z1', most_um: 5 },
          { id: 'z2', most_um: 10 },
        ],
        least: 0.1,
        whole: 3,
      },
      result: { objective: 40, prices },
    },
  );
  assert.deepEqual(
    found.map(({ label, before, after, gain }) => [label, before, after, gain]),
    [
      ['z2: deflection limit', 10, 10.1, 0.4],
      ['Least feed', 0.1, 0.099, 0.1],
    ],
  );
});

test('a choice sets its fields and clears what would contradict them', () => {
  const said = {
    sets: { '/cut/speed_rpm': 'speed_rpm', '/cut/feed_mm': '/engagement/feed_mm' },
    clears: ['/cut/speed_m_per_min', '/cut/absent'],
  };
  const job = { cut: { speed_m_per_min: 100, depth_mm: 1 } };
  assert.deepEqual(chosenJob(job, { engagement: { feed_mm: 0.1 } }, { speed_rpm: 900 }, said), {
    cut: { depth_mm: 1, speed_rpm: 900, feed_mm: 0.1 },
  });
  assert.deepEqual(job.cut, { speed_m_per_min: 100, depth_mm: 1 });
});

const rows = {
  type: 'array',
  maxItems: 100,
  items: {
    type: 'object',
    required: ['z_mm'],
    properties: { run: { type: 'integer', title: 'run' }, z_mm: number('mm', 'station'), deviation_um: number('um', 'deviation') },
  },
};
const root = {
  type: 'object',
  properties: {
    quantity: { type: 'string' },
    runs: {
      type: 'array',
      items: { type: 'object', properties: { depth_mm: number('mm', 'depth'), way: { type: 'string', enum: ['to', 'fro'] } } },
    },
    measurements: {
      oneOf: [rows, { type: 'object', properties: { csv: { type: 'string' } } }],
      'x-table': true,
      'x-measured': ['deviation_um'],
      'x-runs': 'runs',
      'x-run-number': 'run',
    },
  },
};
const answer = {
  input: { quantity: 'deviation_um', runs: [{ depth_mm: 1 }], measurements: [{ run: 1, z_mm: 5, deviation_um: 2 }] },
  result: { next_measurement: { changes: 'depth_mm', run: { depth_mm: 1.8, way: 'fro' }, rows: 3, places: { z_mm: [10, 20.5, 30] } } },
};

test('the sheet of the next measurement comes back as rows of a run that was not there', () => {
  const sheet = sheetOf({ input_schema: root }, answer, answer.input);
  const lines = csvOf(sheet).replace('\ufeff', '').trim().split('\r\n');
  assert.deepEqual(lines, ['run,z_mm,depth_mm,way,deviation_um', '2,10,1.8,fro,', '2,20.5,1.8,fro,', '2,30,1.8,fro,']);
  const table = resolve(root.properties.measurements, root);
  const fields = rowFields(table, root);
  const [columns, free, runs] = [wanted(fields), freeOf(fields), runsOf(root, table, root)];
  // Filled in but for its last row, in µm, by a spreadsheet that writes commas.
  const filled = `\ufeff${['run;z_mm;depth_mm;way;deviation_um', '2;10;1,8;fro;4,5', '2;20,5;1,8;fro;5', '2;30;1,8;fro;'].join('\r\n')}`;
  const { file: whole } = readFile(filled);
  const matches = guess(columns, whole.header, ['deviation_um'], whole.rows);
  const file = measuredOnly(whole, matches, ['deviation_um']);
  assert.equal(file.rows.length, 2);
  const conditions = conditionsIn(file, matches, runs);
  assert.deepEqual(
    conditions.map(({ name }) => name),
    ['depth_mm', 'way'],
  );
  assert.equal(lastRun(answer.input.measurements, columns, free, runs, answer.input.runs), 1);
  assert.deepEqual(runsWith(answer.input.runs, conditionsOf(file, matches, runs, conditions)), [
    { depth_mm: 1 },
    { depth_mm: 1.8, way: 'fro' },
  ]);
  const { kept } = othersOf(file, columns, { ...matches, ...Object.fromEntries(conditions.map(one => [`/${one.name}`, one])) }, free);
  const both = joined(answer.input.measurements, { csv: matched(file, columns, matches, kept) }, columns, free);
  assert.equal(both, 'run\tz_mm\tdeviation_um\n1\t5\t2\n2\t10\t4.5\n2\t20.5\t5\n');
});

test('runs that are planned together stand under each other, each with its number', () => {
  const further = { changes: 'way', run: { way: 'to' }, rows: 1, places: { z_mm: [10] } };
  const planned = { next_measurement: { ...answer.result.next_measurement, further_runs: [further] } };
  const sheet = sheetOf({ input_schema: root }, { ...answer, result: planned }, answer.input);
  assert.deepEqual(sheet.changes, ['depth_mm', 'way']);
  const lines = csvOf(sheet).replace('\ufeff', '').trim().split('\r\n');
  assert.deepEqual(lines.slice(-2), ['2,30,1.8,fro,', '3,10,,to,']);
});

test('no sheet where no measurement is advised', () => {
  assert.equal(sheetOf({ input_schema: root }, { ...answer, result: { next_measurement: null } }, answer.input), null);
});
