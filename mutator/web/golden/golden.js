// @ts-check
"use strict";
// Shows the replay of one golden run, which the replay draws twice: as golden and as faulty.
(async () => {
  const drive = await Packed.read("drive"), t = Float64Array.from(drive.t);
  const channels = drive.channels.map(({ values, ...channel }) => {
    const numbers = Float64Array.from(values, (value) => (value === null ? NaN : Number(value))); // infinities are text
    return { ...channel, t, golden: numbers, faulty: numbers };
  });
  const series = { id: drive.name, start: t[0], end: t[t.length - 1], tEnd: drive.tEnd, active: null, marks: drive.marks, channels };
  Replay.show(document.getElementById("replay"), series, drive);
})();
