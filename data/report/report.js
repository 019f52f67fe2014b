// Page of `graspmap report`: 3-D views of maps, and images at full size, from data in the page.
'use strict';

const MAX_LIVE = 3; // maximum number of views with loaded geometry

// Views are created when they become visible. The geometry of the views hidden longest is dropped.
function startViews() {
  const views = new Map();
  const recent = [];
  const watch = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const figure = entry.target;
      if (!entry.isIntersecting) {
        if (views.has(figure)) views.get(figure).visible = false;
        continue;
      }
      if (!views.has(figure)) views.set(figure, new MapView(figure));
      const view = views.get(figure);
      view.visible = true;
      view.ask();
      if (recent.includes(view)) recent.splice(recent.indexOf(view), 1);
      recent.push(view);
      while (recent.length > MAX_LIVE) recent.shift().cells.dropGeometry();
    }
  }, {rootMargin: '100px'});
  for (const figure of document.querySelectorAll('figure.map'))
    if (figure.querySelector('.map-data')) watch.observe(figure);
}

function tellThatNoView() {
  for (const viewport of document.querySelectorAll('.viewport')) {
    const text = document.createElement('p');
    text.className = 'still';
    text.textContent = 'The 3-D view needs WebGL, which this browser does not offer.';
    viewport.append(text);
  }
}

// A click shows an image at full size.
function startPictures() {
  const dialog = document.createElement('dialog');
  const large = document.createElement('img');
  dialog.append(large);
  document.body.append(dialog);
  dialog.addEventListener('click', () => dialog.close());
  for (const image of document.querySelectorAll('.picture img')) {
    image.tabIndex = 0;
    image.setAttribute('role', 'button');
    const open = () => {
      large.src = image.src;
      large.alt = image.alt;
      dialog.showModal();
    };
    image.addEventListener('click', open);
    image.addEventListener('keydown', (event) => {
      if (event.key !== 'Enter' && event.key !== ' ') return;
      event.preventDefault();
      open();
    });
  }
}

startPictures();
if (document.querySelector('.map-data')) {
  try {
    sharedRenderer();
    startViews();
  } catch (error) {
    tellThatNoView();
  }
}
