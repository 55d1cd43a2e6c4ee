// Steps through the frames of a run: picture, keypoints, view from above, charts and words show the same frame.
'use strict';
(() => {
  const data = JSON.parse(document.getElementById('run-data').textContent);
  const element = (id) => document.getElementById(id);
  const svg = (name) => document.createElementNS('http://www.w3.org/2000/svg', name);
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const rows = data.frames;
  const count = rows.index.length;
  const slider = element('frame');
  const canvas = element('picture');
  const pen = canvas.getContext('2d');
  let now = 0;
  let timer = 0;

  // Keypoints: the layout is that of keypoint_marks.rs.
  const decoded = (text) => {
    const source = bytes(text);
    let at = 0;
    return data.fates.map((fate) => {
      const length = source[at] + 256 * source[at + 1];
      at += 2;
      let cell = 0;
      const marks = [];
      for (let k = 0; k < length; k += 1) {
        let gap;
        do {
          gap = source[at];
          at += 1;
          cell += gap;
        } while (gap === 255);
        marks.push({ x: cell % data.columns, y: Math.floor(cell / data.columns), dx: 0, dy: 0 });
      }
      marks.forEach((mark, k) => { mark.size = source[at + (k >> 2)] >> (2 * (k & 3)) & 3; });
      at += (length + 3) >> 2;
      if (fate.tails) {
        const square = (root) => root * Math.abs(root);
        for (const mark of marks) {
          mark.dx = square((source[at] & 15) - 8);
          mark.dy = square((source[at] >> 4) - 8);
          at += 1;
        }
      }
      return marks;
    });
  };

  const pictures = data.pictures.map(([row, lines, header, body, keys]) => ({ row, lines, header, body, keys }));
  const nearest = (row) => {
    let best = null;
    for (const picture of pictures) {
      if (!best || Math.abs(picture.row - row) < Math.abs(best.row - row)) best = picture;
    }
    return best;
  };
  const image = (picture) => {
    if (!picture.image && picture.body) {
      const file = atob(data.headers[picture.header]) + atob(picture.body);
      picture.image = new Image();
      picture.image.onload = () => draw();
      picture.image.src = 'data:image/jpeg;base64,' + btoa(file);
    }
    return picture.image;
  };

  const style = getComputedStyle(document.documentElement);
  const draw = () => {
    const picture = nearest(now);
    canvas.hidden = !picture;
    if (!picture) return;
    const scale = canvas.width / data.columns;
    const height = Math.round(picture.lines * scale);
    if (canvas.height !== height) canvas.height = height;
    pen.fillStyle = '#000';
    pen.fillRect(0, 0, canvas.width, canvas.height);
    const here = picture.row === now;
    const view = image(picture);
    pen.globalAlpha = here ? 1 : 0.45;
    if (view && view.complete && view.naturalWidth) pen.drawImage(view, 0, 0, canvas.width, canvas.height);
    picture.marks ??= decoded(picture.keys);
    const drawn = data.fates.map((fate, k) => {
      pen.strokeStyle = style.getPropertyValue('--bright-' + fate.colour);
      pen.lineWidth = fate.colour === 'grey' ? 1 : 1.6;
      pen.beginPath();
      let marks = 0;
      for (const { x, y, size, dx, dy } of picture.marks[k]) {
        const [px, py, radius] = [(x + 0.5) * scale, (y + 0.5) * scale, data.radii[size] * scale];
        pen.moveTo(px + radius, py);
        pen.arc(px, py, radius, 0, 2 * Math.PI);
        if (dx || dy) {
          pen.moveTo(px, py);
          pen.lineTo(px + dx * scale, py + dy * scale);
        }
        marks += 1;
      }
      pen.stroke();
      return marks;
    });
    pen.globalAlpha = 1;
    canvas.dataset.frame = rows.index[picture.row];
    canvas.dataset.drawn = drawn.join(' ');
    canvas.dataset.picture = view && view.complete && view.naturalWidth ? 'shown' : 'none';
  };

  // The robot on the view from above.
  const map = document.querySelector('.wide .plot');
  const ellipse = svg('ellipse');
  const robot = svg('path');
  ellipse.id = 'covariance';
  robot.id = 'robot';
  robot.setAttribute('d', 'M16 0L-11 -11L-6 0L-11 11Z');
  map.querySelector('g[clip-path]').append(ellipse, robot);
  const tenth = (value) => value / 10;
  const drive = () => {
    const at = `translate(${tenth(rows.x[now])} ${tenth(rows.y[now])})`;
    // Where the drawing is small the robot is not.
    const size = Math.max(1, 600 / Math.max(1, map.getBoundingClientRect().width));
    robot.setAttribute('transform', `${at} rotate(${-rows.heading[now]}) scale(${size})`);
    ellipse.setAttribute('transform', `${at} rotate(${-rows.angle[now]})`);
    ellipse.setAttribute('rx', tenth(rows.major[now]));
    ellipse.setAttribute('ry', tenth(rows.minor[now]));
  };

  // A line in every chart.
  const charts = [...document.querySelectorAll('.grid .plot[data-x]')].map((plot) => {
    const [from, to, left, width, top, height] = plot.dataset.x.split(' ').map(Number);
    const line = svg('line');
    line.setAttribute('class', 'now');
    line.setAttribute('y1', top);
    line.setAttribute('y2', top + height);
    plot.append(line);
    return { plot, line, from, to, left, width };
  });
  const tick = () => {
    for (const { line, from, to, left, width } of charts) {
      const x = left + (rows.t[now] - from) / (to - from) * width;
      line.setAttribute('x1', x);
      line.setAttribute('x2', x);
    }
  };

  const words = () => {
    const said = [];
    if (rows.state[now] === 'l') {
      said.push('Lost: the images show nothing of the map where it is expected. The pose is that of the odometry, and its covariance grows.');
    } else if (rows.state[now] === 'r') {
      said.push('Found again: with this frame the robot was recognised in the map.');
    } else {
      said.push(rows.key[now] === '1' ? 'Tracking; the frame is a filter step.' : 'Tracking; the pose is refined between two filter steps.');
    }
    if (rows.revisit[now] === '1') said.push('Revisit: an old place was recognised, and the path since then was corrected.');
    if (rows.doubted[now] === '1') said.push('The odometry was taken for that of slipping wheels.');
    for (const note of data.noted[rows.index[now]] ?? []) said.push(`Note: ${data.notes[note]}.`);
    const picture = nearest(now);
    if (picture && picture.row !== now) said.push(`The picture is that of frame ${rows.index[picture.row]}, the nearest one that was kept.`);
    return said.join(' ');
  };
  const facts = [
    ['Keypoints', 'keypoints'], ['Matched and used (inliers)', 'matches'], ['Rejected (outliers)', 'outliers'],
    ['New landmarks', 'fresh'], ['Landmarks in the map', 'landmarks'],
  ].map(([name, column]) => {
    const line = element('facts').insertRow();
    const head = document.createElement('th');
    head.textContent = name;
    line.append(head);
    return { cell: line.insertCell(), column };
  });

  const show = (row) => {
    now = Math.max(0, Math.min(count - 1, row));
    slider.value = now;
    const place = `Frame ${rows.index[now]} of 0 to ${data.total - 1}`;
    element('place').textContent = `${place}, ${rows.t[now].toFixed(2)} s`;
    element('where').textContent = `${rows.index[now]} · ${rows.t[now].toFixed(2)} s`;
    element('state').textContent = words();
    element('player').dataset.state = { t: 'tracking', l: 'lost', r: 'relocalised' }[rows.state[now]];
    slider.setAttribute('aria-valuetext', place);
    for (const { cell, column } of facts) cell.textContent = rows[column][now];
    draw();
    drive();
    tick();
  };
  const stop = () => {
    clearInterval(timer);
    timer = 0;
    element('play').textContent = '▶';
    element('play').setAttribute('aria-label', 'play');
  };
  const play = () => {
    if (timer) {
      stop();
      return;
    }
    if (now === count - 1) show(0);
    element('play').textContent = '⏸';
    element('play').setAttribute('aria-label', 'stop');
    timer = setInterval(() => (now < count - 1 ? show(now + 1) : stop()), 100);
  };

  // Revisits and lost stretches on the slider.
  const mark = (kind, from, to) => {
    const place = document.createElement('i');
    place.className = kind;
    place.style.left = `${100 * from / Math.max(1, count - 1)}%`;
    place.style.width = `${100 * (to - from) / Math.max(1, count - 1)}%`;
    place.dataset.frames = `${rows.index[from]} ${rows.index[to]}`;
    element('marks').append(place);
  };
  for (let row = 0; row < count; row += 1) {
    if (rows.state[row] === 'l') {
      const from = row;
      while (row + 1 < count && rows.state[row + 1] === 'l') row += 1;
      mark('lost', from, row);
    }
  }
  for (let row = 0; row < count; row += 1) {
    if (rows.state[row] === 'r') mark('found', row, row);
    if (rows.revisit[row] === '1') mark('revisit', row, row);
  }

  // Where a click lies in the units of a drawing.
  const spot = (plot, event) => new DOMPoint(event.clientX, event.clientY).matrixTransform(plot.getScreenCTM().inverse());
  const closest = (distance) => {
    let best = 0;
    for (let row = 1; row < count; row += 1) if (distance(row) < distance(best)) best = row;
    stop();
    show(best);
  };
  map.addEventListener('click', (event) => {
    const { x, y } = spot(map, event);
    closest((row) => Math.hypot(tenth(rows.x[row]) - x, tenth(rows.y[row]) - y));
  });
  for (const { plot, from, to, left, width } of charts) {
    plot.addEventListener('click', (event) => {
      const t = from + (spot(plot, event).x - left) / width * (to - from);
      closest((row) => Math.abs(rows.t[row] - t));
    });
  }
  slider.addEventListener('input', () => { stop(); show(Number(slider.value)); });
  element('play').addEventListener('click', play);
  document.addEventListener('keydown', (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || event.target.closest('summary, pre')) return;
    const steps = {
      ArrowLeft: () => { stop(); show(now - 1); },
      ArrowRight: () => { stop(); show(now + 1); },
      Home: () => { stop(); show(0); },
      End: () => { stop(); show(count - 1); },
      ' ': play,
    };
    if (steps[event.key]) {
      event.preventDefault();
      steps[event.key]();
    }
  });
  // A button that has the focus would be pressed by the space key a second time.
  element('play').addEventListener('keyup', (event) => { if (event.key === ' ') event.preventDefault(); });

  slider.max = count - 1;
  document.documentElement.classList.add('scripted');
  element('player').hidden = false;
  element('scrub').hidden = false;
  show(0);
})();
