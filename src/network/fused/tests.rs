//! Fused layers against plain ones, and their parts.

use super::*;
use dfdx::nn::modules;

const ROWS: usize = 7;

/// Gradients of the same tensors in two passes.
macro_rules! gradients_close {
    ($ours:expr, $plain:expr; $($tensor:expr),*) => {$(
        let (ours, plain) = ($ours.get(&$tensor), $plain.get(&$tensor));
        close(stringify!($tensor), &ours.as_vec(), &plain.as_vec());
    )*};
}

fn close(what: &str, ours: &[f32], plain: &[f32]) {
    assert_eq!(ours.len(), plain.len());
    for (a, b) in ours.iter().zip(plain) {
        assert!(
            (a - b).abs() < 1e-5 * (1.0 + b.abs()),
            "{what}: {a}, plain {b}"
        );
    }
}

fn input(device: &Cpu) -> PlainBatch<Const<21>> {
    device.sample_normal_like(&(ROWS, Const::<21>))
}

/// Output, and gradients of input, weight and bias, of a loss with a different slope for each output.
fn run<L>(layers: &mut L, x: &PlainBatch<Const<21>>) -> (Vec<f32>, Gradients<f32, Cpu>)
where
    L: ModuleMut<TapedBatch<Const<21>>, Output = TapedBatch<Const<18>>, Error = CpuError>,
{
    let out = layers.forward_mut(x.leaky_trace());
    let values = out.retaped::<NoneTape>().as_vec();
    let slopes = (0..ROWS * 18).map(|i| (i % 5) as f32 - 1.5).collect();
    let slopes: PlainBatch<Const<18>> = x.device().tensor_from_vec(slopes, (ROWS, Const));
    (values, (out * slopes).sum().backward())
}

/// An activation that is a plain layer too.
trait Plain:
    Activation + ModuleMut<TapedBatch<Const<18>>, Output = TapedBatch<Const<18>>, Error = CpuError>
{
}
impl Plain for ReLU {}
impl Plain for Leaky {}
impl Plain for Tanh {}

fn norm_dense_equals_plain<A: Plain>() {
    let device = Cpu::seed_from_u64(3);
    let mut fused = device.build_module::<NormDense<21, 18, A>, f32>();
    fused.gamma = device.sample_normal();
    fused.beta = device.sample_normal();
    let x = input(&device);
    let mut plain = (
        modules::Linear {
            weight: fused.weight.clone(),
            bias: fused.bias.clone(),
        },
        modules::LayerNorm1D {
            gamma: fused.gamma.clone(),
            beta: fused.beta.clone(),
            epsilon: 1e-5,
        },
        A::default(),
    );
    let (ours, of_ours) = run(&mut fused, &x);
    let (theirs, of_theirs) = run(&mut plain, &x);
    close("output", &ours, &theirs);
    close("evaluation", &fused.forward(x.clone()).as_vec(), &ours);
    gradients_close!(of_ours, of_theirs; x, fused.weight, fused.bias, fused.gamma, fused.beta);
}

fn dense_equals_plain<A: Plain>() {
    let device = Cpu::seed_from_u64(4);
    let mut fused = device.build_module::<Dense<21, 18, A>, f32>();
    let x = input(&device);
    let linear = modules::Linear {
        weight: fused.weight.clone(),
        bias: fused.bias.clone(),
    };
    let (ours, of_ours) = run(&mut fused, &x);
    let (theirs, of_theirs) = run(&mut (linear, A::default()), &x);
    close("output", &ours, &theirs);
    close("evaluation", &fused.forward(x.clone()).as_vec(), &ours);
    gradients_close!(of_ours, of_theirs; x, fused.weight, fused.bias);
}

#[test]
fn fused_layers_equal_plain_ones() {
    dense_equals_plain::<ReLU>();
    dense_equals_plain::<Leaky>();
    dense_equals_plain::<Tanh>();
    norm_dense_equals_plain::<ReLU>();
    norm_dense_equals_plain::<Leaky>();
    norm_dense_equals_plain::<Tanh>();
}

/// The gradient knows which outputs were dropped: a dropped one passes nothing back.
#[test]
fn dropout_has_its_gradient() {
    let device = Cpu::seed_from_u64(5);
    let mut fused = device.build_module::<Dense<21, 18, Tanh>, f32>();
    fused.p = 0.4;
    let x = input(&device);
    let whole = fused.forward(x.clone()).as_vec();
    let (out, gradients) = run(&mut fused, &x);
    let mut of_bias = [0.0; 18];
    for (i, (out, whole)) in out.iter().zip(&whole).enumerate() {
        let kept = if *out == 0.0 { 0.0 } else { 1.0 / 0.6 };
        assert!((out - whole * kept).abs() < 1e-6);
        of_bias[i % 18] += ((i % 5) as f32 - 1.5) * kept * (1.0 - whole * whole);
    }
    close("bias", &gradients.get(&fused.bias).as_vec(), &of_bias);
    let dropped = out.iter().filter(|v| **v == 0.0).count();
    assert!((20..80).contains(&dropped), "{dropped} of {}", out.len());
}

#[test]
fn an_input_that_is_not_contiguous_is_read_in_its_order() {
    let device = Cpu::seed_from_u64(6);
    let fused = device.build_module::<Dense<21, 18, Tanh>, f32>();
    let turned: Tensor<(Const<21>, usize), f32, Cpu> =
        device.sample_normal_like(&(Const::<21>, ROWS));
    let view: PlainBatch<Const<21>> = turned.permute();
    let copy: PlainBatch<Const<21>> = device.tensor_from_vec(view.as_vec(), (ROWS, Const));
    assert_eq!(fused.forward(view).as_vec(), fused.forward(copy).as_vec());
}

fn dropped(rows: usize, outputs: usize, probability: f32, seed: u64) -> Vec<f32> {
    let mut z = vec![1.0; rows * outputs];
    let mask = DropoutMask { probability, seed };
    forward::<ReLU>(&mut z, &vec![0.0; outputs], None, Some(mask));
    z
}

#[test]
fn dropout_has_its_rate_and_keeps_the_mean() {
    for p in [0.1f32, 0.15, 0.5] {
        let out = dropped(1000, 200, p, 7);
        let n = out.len() as f64;
        let zeros = out.iter().filter(|v| **v == 0.0).count() as f64;
        let sigma = (n * f64::from(p) * f64::from(1.0 - p)).sqrt();
        assert!(
            (zeros - n * f64::from(p)).abs() < 4.0 * sigma,
            "{p}: {zeros}"
        );
        let kept = 1.0 / (1.0 - p);
        assert!(out.iter().all(|v| *v == 0.0 || *v == kept));
    }
}

#[test]
fn neighbours_in_row_column_and_seed_are_dropped_independently() {
    let (rows, outputs) = (400, 256);
    let a = dropped(rows, outputs, 0.5, 1 << 40);
    let b = dropped(rows, outputs, 0.5, (1 << 40) + 1);
    assert_eq!(a, dropped(rows, outputs, 0.5, 1 << 40));
    let agreement = |x: &[f32], y: &[f32]| {
        x.iter().zip(y).filter(|(x, y)| x == y).count() as f64 / y.len() as f64
    };
    // One standard deviation of an agreement is 0.0016.
    for (what, share) in [
        ("seed", agreement(&a, &b)),
        ("row", agreement(&a, &a[outputs..])),
        ("column", agreement(&a, &a[1..])),
    ] {
        assert!((share - 0.5).abs() < 0.008, "{what}: {share}");
    }
}

#[test]
fn rows_are_normalised() {
    let (gamma, beta) = (vec![1.0; 37], vec![0.0; 37]);
    let mut z: Vec<f32> = (0..74).map(|i| (i * i % 23) as f32).collect();
    let saved = forward::<ReLU>(&mut z, &[0.5; 37], Some([&gamma, &beta]), None);
    for row in saved.normalised.chunks_exact(37) {
        let mean: f32 = row.iter().sum::<f32>() / 37.0;
        let square: f32 = row.iter().map(|v| v * v).sum::<f32>() / 37.0;
        assert!(mean.abs() < 1e-5 && (square - 1.0).abs() < 1e-4);
    }
}

#[test]
fn the_fast_tanh_is_tanh() {
    let worst = (-120_000..=120_000)
        .map(|i| i as f32 * 1e-4)
        .map(|z| (<Tanh as Activation>::value(z) - (z as f64).tanh() as f32).abs())
        .fold(0.0, f32::max);
    assert!(worst < 5e-7, "{worst}");
    assert!(<Tanh as Activation>::value(f32::NAN).is_nan());
}

#[test]
fn slopes_are_derivatives() {
    fn check<A: Activation>() {
        for z in [-2.0f32, -0.3, 0.4, 1.5] {
            let h = 1e-2;
            let measured = (A::value(z + h) - A::value(z - h)) / (2.0 * h);
            assert!((A::slope(A::value(z)) - measured).abs() < 1e-3, "{z}");
        }
    }
    check::<ReLU>();
    check::<Leaky>();
    check::<Tanh>();
}
