use super::*;
use crate::network::Leaky;
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

fn input(device: &Cpu) -> Batch<Const<21>> {
    device.sample_normal_like(&(ROWS, Const::<21>))
}

/// Output, and gradients of input, weight and bias, of a loss with a different slope for each output.
fn run<L>(layers: &mut L, x: &Batch<Const<21>>) -> (Vec<f32>, Gradients<f32, Cpu>)
where
    L: ModuleMut<TapedBatch<Const<21>>, Output = TapedBatch<Const<18>>, Error = CpuError>,
{
    let out = layers.forward_mut(x.leaky_trace());
    let values = out.retaped::<NoneTape>().as_vec();
    let slopes = (0..ROWS * 18).map(|i| (i % 5) as f32 - 1.5).collect();
    let slopes: Batch<Const<18>> = x.device().tensor_from_vec(slopes, (ROWS, Const));
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
    let view: Batch<Const<21>> = turned.permute();
    let copy: Batch<Const<21>> = device.tensor_from_vec(view.as_vec(), (ROWS, Const));
    assert_eq!(fused.forward(view).as_vec(), fused.forward(copy).as_vec());
}
