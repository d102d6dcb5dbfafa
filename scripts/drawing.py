"""What the scripts that draw charts share: colours, the look of a picture, CSV files, gnuplot."""
import csv
import math
import subprocess

INK, MUTED = "#202020", "#707070"
BAND = "#d8d8d8"
# Palette of Okabe and Ito, distinguishable with red-green colour blindness, and a darker shade of
# some colours.
BLACK, GREY = "#000000", "#7f7f7f"
VERMILION, ORANGE, YELLOW = "#d55e00", "#e69f00", "#c9b800"
BLUE, SKY, NAVY = "#0072b2", "#56b4e9", "#00395c"
GREEN, PINE = "#009e73", "#00513b"
PURPLE, PLUM = "#cc79a7", "#7a3b63"
BROWN = "#8c5a00"

# An estimator has the same colour in every chart, and in plot's picture of the demo.
ESTIMATORS = {"replica": VERMILION, "timing": PURPLE, "both": BLUE, "adaptive": GREEN,
              "Moreau replica": GREY}


def rows(directory, name):
    with open(directory / f"{name}.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def number(text):
    try:
        return float(text)
    except ValueError:
        return math.nan


def plain(text):
    """Text of data, escaped so that neither gnuplot's enhanced mode nor a shell interprets it."""
    text = "".join(c if c.isprintable() else "?" for c in text).replace("`", "'")
    return text.replace("\\", "\\\\").replace("_", "\\\\_").replace('"', "'").replace("^", "\\\\^")


def block(name, points):
    return [f"${name} << EOD", *(" ".join(f"{x:.8g}" for x in point) for point in points), "EOD"]


def draw(directory, name, width, height, body, suffixes=(".png",)):
    for suffix in suffixes:
        picture = directory / f"{name}{suffix}"
        terminal = "pngcairo" if suffix == ".png" else "svg"
        script = [
            f"set terminal {terminal} enhanced size {width},{height} font 'DejaVu Sans,11' "
            "background '#ffffff'",
            "set encoding utf8",
            f"set border 3 lw 1 lc rgb '{MUTED}'",
            f"set tics nomirror out scale 0.6 textcolor rgb '{INK}'",
            "set grid xtics ytics lt 1 lw 0.8 lc rgb '#dddddd'",
            "unset key",
        ]
        # Through a pipe, because gnuplot does not report a full disk.
        drawn = subprocess.run(["gnuplot", "-d"], input=("\n".join(script + body) + "\n").encode(),
                               stdout=subprocess.PIPE, check=True)
        picture.write_bytes(drawn.stdout)
    print(directory / f"{name}.png")
