use super::text::BOLD;
use super::*;

fn chart(panels: usize, lines: usize, samples: usize) -> Chart {
    let wave = |k: usize| (k as f64 * 0.05, (k as f64 * 0.7).sin() + (k % 17) as f64);
    let line = |j: usize| Series::new("line", Style::OTHERS[j % 5], (0..samples).map(wave));
    Chart {
        title: "a < b & \"c\"\u{1}".into(),
        description: "lines".into(),
        x: "t in s".into(),
        panels: (0..panels)
            .map(|_| Panel::new("y in V", (0..lines).map(line).collect()))
            .collect(),
    }
}

/// Values of all attributes called `name`.
fn attributes<'a>(svg: &'a str, name: &'a str) -> impl Iterator<Item = &'a str> {
    let starts = svg.match_indices(name).map(|(i, _)| &svg[i + name.len()..]);
    starts.filter_map(|rest| rest.strip_prefix("=\"")?.split('"').next())
}

#[test]
fn long_records_stay_small() {
    for panels in [1, 4, 16] {
        let svg = chart(panels, 3, 50_000).svg();
        assert!(
            svg.len() < 300 * 1024,
            "{panels} panels: {} bytes",
            svg.len()
        );
    }
}

#[test]
fn text_is_escaped_and_spoken() {
    let svg = chart(1, 1, 10).svg();
    assert!(svg.contains("<title>a &lt; b &amp; &quot;c&quot; </title>"));
    assert!(svg.contains("role=\"img\"") && svg.contains("<desc>lines</desc>"));
    assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
}

#[test]
fn everything_is_inside_the_picture() {
    let mut wide = chart(2, 3, 100);
    wide.panels[0].y =
        "a very long name of a quantity that does not fit anywhere at all in this".into();
    for series in wide.panels.iter_mut().flat_map(|p| &mut p.series) {
        series.label = "a label that takes most of a row".into();
        series
            .points
            .iter_mut()
            .for_each(|p| p.1 = 1e6 + 1e-2 * p.1);
    }
    let svg = wide.svg();
    let size: Vec<f64> = (attributes(&svg, "viewBox").next().unwrap().split(' '))
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
    let mut holed = chart(1, 1, 10);
    holed.panels[0].series[0].points[4].1 = f64::NAN;
    let path = holed.svg();
    let line = attributes(&path, " d").last().unwrap().to_owned();
    assert_eq!(line.matches('M').count(), 2);
    assert!(!path.contains("NaN") && !path.contains("inf"));
    let empty = chart(1, 0, 0).svg();
    assert!(!empty.contains("NaN"), "{empty}");
    assert!(chart(0, 0, 0).svg().ends_with("</svg>\n"));
}
