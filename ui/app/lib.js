// The one place from which the vendored libraries come.
import { h, render, Component as Base, Fragment } from './vendor/preact.module.js';
import htm from './vendor/htm.module.js';

import { useState, useEffect } from './vendor/hooks.module.js';

export { useState, useEffect, useLayoutEffect, useMemo, useRef, useCallback, useReducer } from './vendor/hooks.module.js';
/** @type {{ new (): { state: any, setState(state: any): void } }} */
export const Component = /** @type {any} */ (Base);
export { h, render, Fragment };
export const html = htm.bind(h);

/** Calls `task` after `wait` ms without another call. */
export function debounced(task, wait) {
  let timer;
  const later = (...values) => {
    clearTimeout(timer);
    timer = setTimeout(() => task(...values), wait);
  };
  later.cancel = () => clearTimeout(timer);
  return later;
}

/** A store that components may watch. */
export function cell(first) {
  const watchers = new Set();
  let value = first;
  return {
    get: () => value,
    set: next => {
      value = next;
      watchers.forEach(watcher => watcher(value));
    },
    watch: watcher => {
      watchers.add(watcher);
      return () => watchers.delete(watcher);
    },
  };
}

/** Whether the page is being put on paper. */
export function usePrinting() {
  const [isPrinting, setPrinting] = useState(false);
  useEffect(() => {
    const before = () => setPrinting(true);
    const after = () => setPrinting(false);
    addEventListener('beforeprint', before);
    addEventListener('afterprint', after);
    return () => {
      removeEventListener('beforeprint', before);
      removeEventListener('afterprint', after);
    };
  }, []);
  return isPrinting;
}

let counter = 0;
/** A name that no other element has. */
export const unique = prefix => `${prefix}-${++counter}`;
