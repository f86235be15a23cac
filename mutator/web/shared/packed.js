// @ts-check
"use strict";
// Reads data that is embedded in a page as gzipped JSON in base64 (web/__init__.py: embedded).

const Packed = (() => {
  const read_ = new Map(); // element id -> promise of its value

  /** The value of a packed text. */
  async function unpack(text) {
    const binary = atob(text.trim()), bytes = new Uint8Array(binary.length);
    for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return JSON.parse(await new Response(stream).text());
  }

  /** The value in the element `id`, which is unpacked once; null if there is no such element. */
  function read(id) {
    if (!read_.has(id)) {
      const element = document.getElementById(id);
      read_.set(id, element ? unpack(element.textContent) : Promise.resolve(null));
    }
    return read_.get(id);
  }

  return { unpack, read };
})();
