#!/usr/bin/python3
"""Regenerates the images of tools/manual with the commands of the pages.

manual_pictures.py BUILD_FOLDER SOURCE_FOLDER [PAGE...]

The commands of each page PAGE.md write PAGE.png, and further images that the page shows. They are
copied to tools/manual/pictures, or, if larger than 60,000 bytes, converted to a JPEG and scaled down to
this size. The page shows them by the resulting names. Inspect the changed images.
"""

import pathlib
import re
import subprocess
import sys
import tempfile

from vtkmodules.vtkImagingCore import vtkImageExtractComponents, vtkImageResize
from vtkmodules.vtkIOImage import vtkJPEGWriter, vtkPNGReader

LARGEST = 60_000
WIDEST = 960
# Scale of the sides, quality of the JPEG.
ATTEMPTS = [(1.0, 90), (1.0, 80), (1.0, 70), (0.85, 75), (0.7, 75), (0.5, 75)]


def write_jpeg(source, target, scale, quality):
    """Writes the image scaled down."""
    reader = vtkPNGReader()
    reader.SetFileName(str(source))
    rgb = vtkImageExtractComponents()
    rgb.SetInputConnection(reader.GetOutputPort())
    rgb.SetComponents(0, 1, 2)
    rgb.Update()
    width, height, _ = rgb.GetOutput().GetDimensions()
    factor = scale * min(1.0, WIDEST / width)
    resized = vtkImageResize()
    resized.SetInputConnection(rgb.GetOutputPort())
    resized.SetOutputDimensions(round(width * factor), round(height * factor), 1)
    writer = vtkJPEGWriter()
    writer.SetInputConnection((resized if factor < 1 else rgb).GetOutputPort())
    writer.SetQuality(quality)
    writer.ProgressiveOff()
    writer.SetFileName(str(target))
    writer.Write()


def put_picture(source, folder):
    """Writes the image into the folder, at most 60,000 bytes, and removes the earlier image."""
    for extension in (".png", ".jpg"):
        (folder / source.name).with_suffix(extension).unlink(missing_ok=True)
    if source.stat().st_size <= LARGEST:
        (folder / source.name).write_bytes(source.read_bytes())
        return
    target = (folder / source.name).with_suffix(".jpg")
    for scale, quality in ATTEMPTS:
        write_jpeg(source, target, scale, quality)
        if target.stat().st_size <= LARGEST:
            return
    sys.exit(f"{source.name}: larger than {LARGEST} bytes however small")


def main():
    build, source = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
    manual = source / "tools/manual"
    pages = sys.argv[3:] or sorted(path.stem for path in manual.glob("*.md")
                                   if path.stem.islower())
    run = [sys.executable, str(pathlib.Path(__file__).parent / "check_transcripts.py"), str(build),
           str(source)]
    with tempfile.TemporaryDirectory() as scratch:
        example = f"{scratch}/example"
        subprocess.run([*run, str(manual / "README.md"), "--in", example], check=True)
        for page in pages:
            subprocess.run([*run, str(manual / f"{page}.md"), "--begin-with", example, "--in",
                            f"{scratch}/{page}"], check=True)
            text = (manual / f"{page}.md").read_text(encoding="utf-8")
            for name in [page, *re.findall(r"\(pictures/(\w+)\.", text)]:
                picture = pathlib.Path(scratch) / page / f"{name}.png"
                if picture.is_file():
                    put_picture(picture, manual / "pictures")


if __name__ == "__main__":
    main()
