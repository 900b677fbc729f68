//! Values of a graph as a straight list of operations, each of which goes over all points at once.
//!
//! Numbers stand in groups of `G`. What differs from point to point has one group for every `G` points; what is the same for all of
//! them, or belongs to a lane, has one. What θ alone decides is computed again only where θ has changed.

mod feed;
mod groups;
mod scratch;

pub(super) use feed::{LanesFeed, PointsFeed};

use super::graph::{Graph, Id, Node, Varies};
use feed::TapeFeed;
use groups::{Place, PlacedOperation, Work, load, run_all, store};
use scratch::{Numbers, keep_numbers, new_id, take_numbers};
use std::cell::Cell;

/// Numbers of a value that go through an operation together: those of all values of a small twin then stay in the fastest memory. Twice
/// as many do not for ten operations; half of it pays the choice of the operation more often.
const BLOCK: usize = 64;

/// Place of a value.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Slot {
    /// One group for all points.
    Same(u32),
    /// A group for every `G` points.
    Each(u32),
}

/// `to` becomes `work` of what is in `of`.
#[derive(Debug, Clone, Copy)]
struct Operation {
    work: Work,
    to: Slot,
    of: [Slot; 3],
}

/// A list of operations.
#[derive(Debug)]
pub(super) struct OperationTape {
    id: u64,
    constants: Vec<(f64, Slot)>,
    parameters: Vec<(usize, Slot)>,
    inputs: Vec<(usize, Slot)>,
    time: Option<Slot>,
    states: Vec<(usize, Slot)>,
    /// Operations by what they depend on: θ, the step, states.
    by_parameters: Vec<Operation>,
    by_step: Vec<Operation>,
    by_state: Vec<Operation>,
    outputs: Vec<Slot>,
    /// Number of slots of either kind.
    same: u32,
    each: u32,
    /// Outputs that are always these numbers.
    pub fixed: Option<Vec<f64>>,
    /// States that the outputs are.
    pub plain: Option<Vec<usize>>,
}

/// Slots while a tape is written: those of values that nothing needs any more are taken again.
struct Slots {
    of: Vec<Option<Slot>>,
    /// Last operation that needs a value.
    last: Vec<usize>,
    free: Vec<u32>,
    same: u32,
    each: u32,
}

impl Slots {
    fn take(&mut self, id: Id, varies: Varies) -> Slot {
        let slot = if varies < Varies::ByState {
            self.same += 1;
            Slot::Same(self.same - 1)
        } else if let Some(free) = self.free.pop() {
            Slot::Each(free)
        } else {
            self.each += 1;
            Slot::Each(self.each - 1)
        };
        self.of[id] = Some(slot);
        slot
    }

    fn get(&self, id: Id) -> Slot {
        self.of[id].unwrap_or(Slot::Same(0))
    }

    /// Frees what operation `at` was the last to need.
    fn release(&mut self, at: Id, operands: &[Id]) {
        for (k, &id) in operands.iter().enumerate() {
            if self.last[id] == at
                && !operands[..k].contains(&id)
                && let Some(Slot::Each(index)) = self.of[id]
            {
                self.free.push(index);
            }
        }
    }
}

impl OperationTape {
    /// Writes what these values of a graph need.
    pub fn new(graph: &Graph, outputs: &[Id]) -> Self {
        let mut needed = vec![false; graph.len()];
        let mut last: Vec<usize> = (0..graph.len()).collect();
        for &id in outputs {
            (needed[id], last[id]) = (true, usize::MAX);
        }
        for id in (0..graph.len()).rev() {
            if needed[id] {
                let (of, count) = graph.get(id).0.operands();
                for &operand in &of[..count] {
                    needed[operand] = true;
                    last[operand] = last[operand].max(id);
                }
            }
        }
        let mut slots = Slots {
            of: vec![None; graph.len()],
            last,
            free: vec![],
            same: 0,
            each: 0,
        };
        let mut tape = Self {
            id: new_id(),
            constants: vec![],
            parameters: vec![],
            inputs: vec![],
            time: None,
            states: vec![],
            by_parameters: vec![],
            by_step: vec![],
            by_state: vec![],
            outputs: vec![],
            same: 0,
            each: 0,
            fixed: outputs.iter().map(|&id| graph.constant(id)).collect(),
            plain: (outputs.iter())
                .map(|&id| match graph.get(id).0 {
                    Node::State(state) => Some(state),
                    _ => None,
                })
                .collect(),
        };
        // States are loaded before any operation, so that none of these takes their place.
        let all = || (0..graph.len()).filter(|id| needed[*id]);
        for id in all() {
            if let (Node::State(state), varies) = graph.get(id) {
                tape.states.push((state, slots.take(id, varies)));
            }
        }
        for id in all() {
            tape.write(graph, id, &mut slots);
        }
        tape.outputs = outputs.iter().map(|&id| slots.get(id)).collect();
        (tape.same, tape.each) = (slots.same, slots.each);
        tape
    }

    /// Writes one value behind those that it needs.
    fn write(&mut self, graph: &Graph, id: Id, slots: &mut Slots) {
        let (node, varies) = graph.get(id);
        let work = match node {
            Node::State(_) => return,
            Node::Number(bits) => {
                let slot = slots.take(id, varies);
                return self.constants.push((f64::from_bits(bits), slot));
            }
            Node::Parameter(index) => {
                let slot = slots.take(id, varies);
                return self.parameters.push((index, slot));
            }
            Node::Input(index) => {
                let slot = slots.take(id, varies);
                return self.inputs.push((index, slot));
            }
            Node::Time => {
                self.time = Some(slots.take(id, varies));
                return;
            }
            Node::One(operation, _) => Work::One(operation),
            Node::Two(operation, ..) => Work::Two(operation),
            Node::If(..) => Work::If,
        };
        let (ids, count) = node.operands();
        let of = ids.map(|id| slots.get(id));
        // A result may stand where an operand stood: each group is read before it is written.
        slots.release(id, &ids[..count]);
        let to = slots.take(id, varies);
        let list = match varies {
            Varies::Never | Varies::ByParameters => &mut self.by_parameters,
            Varies::ByStep => &mut self.by_step,
            Varies::ByState => &mut self.by_state,
        };
        list.push(Operation { work, to, of });
    }

    /// Computes the outputs of all points of a feed.
    pub fn run<const G: usize>(&self, feed: &mut impl TapeFeed<G>) {
        let kind = (self.id, G);
        let mut numbers = take_numbers(kind).unwrap_or_else(|| self.begin::<G>());
        let cells = Cell::from_mut(&mut numbers.values[..]).as_slice_of_cells();
        self.prepare(feed, cells, &numbers.operations);
        self.each_block(feed, cells, &numbers.operations[2]);
        keep_numbers(kind, numbers);
    }

    /// First number of the first slot that has many groups.
    #[inline(always)]
    fn first<const G: usize>(&self) -> usize {
        self.same as usize * G
    }

    /// Returns numbers and operations of a thread that has none of this tape yet.
    #[cold]
    fn begin<const G: usize>(&self) -> Box<Numbers> {
        let first = self.first::<G>();
        let mut values = vec![f64::NAN; first + self.each as usize * (together(G) * G)];
        for &(value, slot) in &self.constants {
            let at = place::<G>(slot, first).0 as usize;
            values[at..at + G].fill(value);
        }
        let lists = [&self.by_parameters, &self.by_step, &self.by_state];
        let operations = lists.map(|list| {
            let placed = |operation: &Operation| PlacedOperation {
                work: operation.work,
                to: place::<G>(operation.to, first),
                of: operation.of.map(|slot| place::<G>(slot, first)),
            };
            list.iter().map(placed).collect()
        });
        Box::new(Numbers { values, operations })
    }

    /// Computes what is the same for all points.
    fn prepare<const G: usize>(
        &self,
        feed: &impl TapeFeed<G>,
        numbers: &[Cell<f64>],
        [by_parameters, by_step, _]: &[Vec<PlacedOperation>; 3],
    ) {
        let first = self.first::<G>();
        let at = |slot| place::<G>(slot, first).0 as usize;
        let mut is_changed = false;
        for &(index, slot) in &self.parameters {
            let value = feed.parameter(index);
            // Before the first call the numbers are none, and differ from any.
            is_changed |= load::<G>(numbers, at(slot)) != value;
            store(numbers, at(slot), value);
        }
        if is_changed {
            run_all::<G>(by_parameters, numbers, 1);
        }
        for &(index, slot) in &self.inputs {
            store(numbers, at(slot), feed.input(index));
        }
        if let Some(slot) = self.time {
            store(numbers, at(slot), feed.time());
        }
        if !by_step.is_empty() {
            run_all::<G>(by_step, numbers, 1);
        }
    }

    /// Computes what differs from point to point, a block of points after the other.
    fn each_block<const G: usize>(
        &self,
        feed: &mut impl TapeFeed<G>,
        numbers: &[Cell<f64>],
        by_state: &[PlacedOperation],
    ) {
        let (first, groups) = (self.first::<G>(), feed.groups());
        for begin in (0..groups).step_by(together(G)) {
            let count = together(G).min(groups - begin);
            for &(state, slot) in &self.states {
                let start = place::<G>(slot, first).0 as usize;
                for k in 0..count {
                    store(numbers, start + k * G, feed.state(state, begin + k));
                }
            }
            run_all::<G>(by_state, numbers, count);
            for (output, &slot) in self.outputs.iter().enumerate() {
                let (start, step) = place::<G>(slot, first);
                for k in 0..count {
                    let at = start as usize + k * step as usize;
                    feed.give(output, begin + k, load(numbers, at));
                }
            }
        }
    }
}

/// Groups of a value that go through an operation together.
const fn together(group: usize) -> usize {
    if group >= BLOCK { 1 } else { BLOCK / group }
}

/// Returns the place of a slot; `first` is that of the first slot that has many groups.
#[inline(always)]
fn place<const G: usize>(slot: Slot, first: usize) -> Place {
    match slot {
        Slot::Same(index) => (index * G as u32, 0),
        Slot::Each(index) => (first as u32 + index * (together(G) * G) as u32, G as u32),
    }
}
