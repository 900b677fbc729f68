use super::canvas::{BOLD, width};
use super::*;

fn panels(panels: usize, lines: usize, samples: usize) -> Vec<Panel> {
    let wave = |k: usize| (k as f64 * 0.05, (k as f64 * 0.7).sin() + (k % 17) as f64);
    let line = |j: usize| Line::new("line", Style::OTHERS[j % 5], (0..samples).map(wave));
    let panel = |_| Panel::new("y in V", (0..lines).map(line).collect());
    (0..panels).map(panel).collect()
}

fn svg(panels: &[Panel]) -> String {
    let axis = ("t in s".to_owned(), panels.to_vec());
    chart("a < b & \"c\"\u{1}", "lines", &[axis])
}

/// Values of all attributes called `name`.
fn attributes<'a>(svg: &'a str, name: &'a str) -> impl Iterator<Item = &'a str> {
    let starts = svg.match_indices(name).map(|(i, _)| &svg[i + name.len()..]);
    starts.filter_map(|rest| rest.strip_prefix("=\"")?.split('"').next())
}

#[test]
fn long_records_stay_small() {
    for count in [1, 4, 16] {
        let bytes = svg(&panels(count, 3, 50_000)).len();
        assert!(bytes < 300 * 1024, "{count} panels: {bytes} bytes");
    }
}

#[test]
fn text_is_escaped_and_spoken() {
    let svg = svg(&panels(1, 1, 10));
    assert!(svg.contains("<title>a &lt; b &amp; &quot;c&quot; </title>"));
    assert!(svg.contains("role=\"img\"") && svg.contains("<desc>lines</desc>"));
    assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
}

#[test]
fn everything_is_inside_the_picture() {
    let mut wide = panels(2, 3, 100);
    wide[0].y = "a very long name of a quantity that does not fit anywhere at all in this".into();
    for series in wide.iter_mut().flat_map(|p| &mut p.series) {
        series.label = "a label that takes most of a row".into();
        series
            .points
            .iter_mut()
            .for_each(|p| p.1 = 1e6 + 1e-2 * p.1);
    }
    wide[1].spans = spans();
    assert_inside(&svg(&wide));
}

/// The frame of a stretch of full weight 0.4.
const FRAMED: &str = "fill-opacity=\"0.22\" stroke=\"#222222\"";

/// Two stretches, the second too narrow for its label.
fn spans() -> Vec<Span> {
    let span = |from: f64, to: f64, clear: bool| Span {
        from,
        to,
        label: "40 %".into(),
        weight: 0.4,
        clear,
    };
    vec![span(0.0, 2.0, true), span(2.0, 2.1, false)]
}

#[test]
fn stretches_are_told_apart_by_their_frames() {
    let mut marked = panels(1, 1, 100);
    let bare = svg(&marked);
    marked[0].spans = spans();
    let svg = svg(&marked);
    assert_eq!(svg.matches("fill-opacity").count(), 2);
    assert_eq!(svg.matches(FRAMED).count(), 1);
    assert_eq!(
        svg.matches(">40 %<").count(),
        1,
        "the narrow one has no room"
    );
    let height = |svg: &str| {
        attributes(svg, "viewBox")
            .next()
            .map(|v| v.split(' ').next_back().unwrap().to_owned())
    };
    assert_ne!(height(&svg), height(&bare));
}

#[test]
fn bars_keep_inside_and_name_what_they_cannot_draw() {
    let bars = [3e9, 0.5, f64::NAN, -1.0, 0.0].map(|value| {
        let label = "a name that takes far more than its share of the row";
        Bar::new(label, value, "3.00e9 (−1.00e12 to 9.99e15)").interval(Some([-1e12, 1e16]))
    });
    let groups = [None, Some(1.0)].map(|full| BarGroup {
        label: "a & b".into(),
        full,
        per_cent: full.is_some(),
        bars: bars.to_vec(),
    });
    let svg = bar_chart("bars", "of any length", &groups);
    assert_inside(&svg);
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    assert_eq!(
        svg.matches("3.00e9").count(),
        10,
        "every bar has its number"
    );
    // One rectangle is the paper; two bars of each group are positive.
    assert_eq!(svg.matches("<rect").count(), 1 + 2 * 2);
    assert!(bar_chart("bars", "none", &[]).ends_with("</svg>\n"));
}

/// Groups of one scale share it, others have their own.
#[test]
fn bars_have_scales() {
    let group = |full| BarGroup::new("", full, vec![Bar::new("a", 0.5, "half")]);
    let groups = [
        group(Some(1.0)),
        group(Some(1.0)),
        group(Some(1.0)).per_cent(),
    ];
    let svg = bar_chart("bars", "of a half", &groups);
    assert_inside(&svg);
    assert_eq!(svg.matches(">0.4<").count(), 1);
    assert_eq!(svg.matches(">40 %<").count(), 1);
}

/// Fails where a text reaches beyond the picture.
fn assert_inside(svg: &str) {
    let size: Vec<f64> = (attributes(svg, "viewBox").next().unwrap().split(' '))
        .map(|v| v.parse().unwrap())
        .collect();
    let texts = svg.split("<text").skip(1).map(|t| {
        let of = |name| attributes(t, name).next().unwrap().to_owned();
        let number = |name| of(name).parse::<f64>().unwrap();
        let content = t.split(['>', '<']).nth(1).unwrap();
        let bold = if t.contains("font-weight") { BOLD } else { 1.0 };
        let (x, long) = (number(" x"), width(content, bold * number("font-size")));
        let start = match of(" text-anchor").as_str() {
            "start" => x,
            "middle" => x - 0.5 * long,
            _ => x - long,
        };
        (content.to_owned(), start, start + long, number(" y"))
    });
    for (content, start, end, y) in texts {
        assert!(
            start >= 0.0 && end <= size[2] && y > 0.0 && y < size[3],
            "{content}: {start} {end} {y}"
        );
    }
}

#[test]
fn lines_break_at_holes_and_nothing_is_drawn_of_nothing() {
    let mut holed = panels(1, 1, 10);
    holed[0].series[0].points[4].1 = f64::NAN;
    let path = svg(&holed);
    let line = attributes(&path, " d").last().unwrap().to_owned();
    assert_eq!(line.matches('M').count(), 2);
    assert!(!path.contains("NaN") && !path.contains("inf"));
    let empty = svg(&panels(1, 0, 0));
    assert!(!empty.contains("NaN"), "{empty}");
    assert!(svg(&[]).ends_with("</svg>\n"));
}

#[test]
fn bands_points_and_marks_stay_inside_and_are_named() {
    let mut layered = panels(1, 1, 50);
    let dot = Dot {
        x: 1.0,
        y: 2.0,
        low: -40.0,
        high: 40.0,
    };
    let mark = |x: f64| TimeMark {
        x,
        label: "onset 2.40 s".into(),
    };
    layered[0].dots = vec![Dots {
        label: "share".into(),
        points: vec![dot],
    }];
    layered[0].areas = vec![Area {
        label: "band".into(),
        points: vec![(0.0, -1.0, 1.0), (1.0, f64::NAN, 1.0), (2.0, -2.0, 2.0)],
    }];
    layered[0].marks = vec![mark(0.1), mark(2.4)];
    let svg = svg(&layered);
    assert_inside(&svg);
    assert!(!svg.contains("NaN"));
    for name in [">share<", ">band<", ">onset 2.40 s<"] {
        assert!(svg.contains(name), "{name}");
    }
    // On the side that has room.
    assert!(svg.contains("text-anchor=\"end\">onset 2.40 s<"));
}

#[test]
fn a_heat_map_tells_cells_apart_by_their_frames() {
    let mut cells = spans();
    cells.push(Span {
        clear: false,
        from: 2.1,
        to: 4.0,
        ..cells[0].clone()
    });
    let row = HeatRow {
        label: "a name that is much too long for the room that names have".into(),
        cells,
        mark: Some(TimeMark {
            x: 3.9,
            label: "onset".into(),
        }),
    };
    let group = HeatGroup {
        label: "twin".into(),
        rows: vec![row],
    };
    let svg = heat_map("Windows", "cells", &[group]);
    assert_inside(&svg);
    assert_eq!(svg.matches(FRAMED).count(), 1);
    assert_eq!(svg.matches("font-weight=\"600\">40 %<").count(), 1);
    assert!(svg.contains(">40 %<") && svg.contains(">onset<"));
}

#[test]
fn curves_have_an_axis_each() {
    let panel = |x: &str, scale: f64| {
        let points = (0..30).map(|k| (scale * k as f64, (k as f64 * 0.2).sin()));
        let line = Line::new("a line with a label that is long", Style::AFTER, points);
        let panel = Panel::new("rate of h in V/s", vec![line]).area(Area {
            label: "± 1 standard error".into(),
            points: vec![(0.0, -1.0, 1.0), (scale * 29.0, f64::NAN, 2.0)],
        });
        (x.to_owned(), vec![panel])
    };
    let long = "a variable with a name so long that it takes more than the width of the picture";
    let svg = chart(
        "Functions",
        "two",
        &[panel("h in V", 0.1), panel(long, 1e6)],
    );
    assert_inside(&svg);
    assert!(!svg.contains("NaN"));
    for text in [">h in V<", ">2.5<", ">2.5e7<"] {
        assert!(svg.contains(text), "{text}: {svg}");
    }
    assert!(chart("Functions", "none", &[]).ends_with("</svg>\n"));
}
