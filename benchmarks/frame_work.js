// Steps a page of the 3D view frame by frame on a simulated clock, with the code path of a graphics processor and drawing
// calls that do nothing: only the work of the page remains. Evaluated before the scripts of the page.
(() => {
  const UNMASKED_RENDERER = 0x9246;
  const gl = WebGL2RenderingContext.prototype, { getParameter } = gl;
  gl.getParameter = function (name) {
    return name === UNMASKED_RENDERER ? "a graphics processor" : getParameter.call(this, name);
  };
  const work = { draws: 0, bytes: 0 };
  for (const name of ["drawArrays", "drawElements", "drawArraysInstanced", "drawElementsInstanced"]) {
    gl[name] = () => { work.draws += 1; };
  }
  for (const name of ["bufferData", "bufferSubData", "texImage2D", "texSubImage2D"]) {
    const send = gl[name];
    gl[name] = function (...values) {
      work.bytes += values.find((value) => value?.byteLength)?.byteLength ?? 0;
      return send.apply(this, values);
    };
  }

  let now = null, queue = []; // [ms] of the simulated clock; callbacks of the next frame
  const ticks = []; // timers faster than a frame, those of the player
  const clock = performance.now.bind(performance), date = Date.now, every = setInterval, ask = requestAnimationFrame;
  const since = Date.now() - clock();
  performance.now = () => now ?? clock();
  Date.now = () => (now === null ? date() : since + now);
  window.requestAnimationFrame = (run) =>
    now === null ? ask((time) => (now === null ? run(time) : queue.push(run))) : queue.push(run);
  window.setInterval = (run, period, ...rest) => {
    if (period >= 20) return every(run, period, ...rest);
    ticks.push(run);
    return every(() => now === null && run(...rest), period);
  };
  const { port1: request, port2: reply } = new MessageChannel(), waiting = [];
  reply.onmessage = () => waiting.shift()();

  window.stepFrames = async (count, rate) => { // returns draw calls, uploaded bytes and simulated time [s] of a frame
    now ??= clock();
    Object.assign(work, { draws: 0, bytes: 0 });
    const begin = lapwingView.time;
    for (let k = 0; k < count; k++) {
      now += 1000 / rate;
      for (const run of ticks) run();
      const due = queue;
      queue = [];
      for (const run of due) run(now);
      await new Promise((done) => { // lets the page handle its messages
        waiting.push(done);
        request.postMessage(0);
      });
    }
    return [work.draws / count, work.bytes / count, (lapwingView.time - begin) / count];
  };
})();
