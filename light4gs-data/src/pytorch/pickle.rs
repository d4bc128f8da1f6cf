//! A pickle as data: the instructions of a saved state dict. No function is ever called.
//!
//! Objects are in one list and refer to each other by index. So no file can nest them too deeply for the stack, and
//! there are at most as many as the file has bytes.

use std::collections::HashMap;

use super::storage::{Scalar, View};
use super::{Problem, problem};

/// Place of an object in its [`Arena`].
pub(super) type Id = usize;

/// The objects of a state dict.
#[derive(Debug)]
pub(super) enum Object {
    Nothing,
    Bool(bool),
    /// Longer integers keep their low 64 bits.
    Integer(i64),
    Float,
    Text(String),
    Tuple(Vec<Id>),
    List(Vec<Id>),
    Dict(Vec<(Id, Id)>),
    /// One of the functions that may be "called".
    Function(Function),
    /// A class of storages.
    StorageClass(Scalar),
    Storage {
        key: String,
        scalar: Scalar,
    },
    Tensor(View),
}

/// The functions that may be "called".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    OrderedDict,
    Size,
    RebuildTensor,
    RebuildParameter,
}

/// All objects of a pickle.
#[derive(Debug, Default)]
pub(super) struct Arena {
    objects: Vec<Object>,
    /// Bytes of a number in every named storage, by key.
    sizes: HashMap<String, usize>,
}

impl Arena {
    pub(super) fn get(&self, id: Id) -> &Object {
        &self.objects[id]
    }

    /// Bytes of a number in a storage.
    pub(super) fn bytes_a_number(&self, key: &str) -> Option<usize> {
        self.sizes.get(key).copied()
    }

    fn add(&mut self, object: Object) -> Id {
        self.objects.push(object);
        self.objects.len() - 1
    }

    fn integers(&self, id: Id) -> Option<Vec<i64>> {
        let items = match self.get(id) {
            Object::Tuple(items) | Object::List(items) => items,
            _ => return None,
        };
        items.iter().map(|item| self.integer(*item)).collect()
    }

    fn integer(&self, id: Id) -> Option<i64> {
        if let Object::Integer(number) = self.get(id) { Some(*number) } else { None }
    }
}

struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    name: &'a str,
    arena: Arena,
    stack: Vec<Id>,
    /// Heights of the stack at its marks.
    marks: Vec<usize>,
    memo: HashMap<u32, Id>,
    /// Objects and characters that may still be copied. It is bounded because a short pickle may refer to a long list
    /// many times.
    budget: usize,
}

/// Runs the pickle at the beginning of `bytes`. Returns its objects, the resulting one, and the pickle's length.
pub(super) fn run(bytes: &[u8], name: &str) -> Result<(Arena, Id, usize), Problem> {
    let (stack, marks, memo) = (Vec::new(), Vec::new(), HashMap::new());
    let budget = 16 * bytes.len();
    let mut machine = Machine { bytes, at: 0, name, arena: Arena::default(), stack, marks, memo, budget };
    loop {
        let at = machine.at;
        let instruction = machine.take(1)?[0];
        if instruction == b'.' {
            let root = machine.pop()?;
            return Ok((machine.arena, root, machine.at));
        }
        machine.step(instruction, at)?;
    }
}

impl<'a> Machine<'a> {
    fn wrong(&self, what: impl Into<String>) -> Problem {
        problem(format!("{}, byte {}", self.name, self.at), what)
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], Problem> {
        let end = self.at.checked_add(length).filter(|end| *end <= self.bytes.len());
        let end = end.ok_or_else(|| self.wrong("the pickle is truncated"))?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn charge(&mut self, amount: usize) -> Result<(), Problem> {
        let left = self.budget.checked_sub(amount);
        self.budget = left.ok_or_else(|| self.wrong("it refers to the same things too often"))?;
        Ok(())
    }

    fn unsigned(&mut self, length: usize) -> Result<usize, Problem> {
        Ok(self.take(length)?.iter().rev().fold(0, |number, byte| number << 8 | usize::from(*byte)))
    }

    fn text(&mut self, length: usize) -> Result<String, Problem> {
        let bytes = self.take(length)?;
        Ok(String::from_utf8_lossy(bytes).into_owned())
    }

    fn line(&mut self) -> Result<String, Problem> {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().take(512).position(|byte| *byte == b'\n');
        let length = length.ok_or_else(|| self.wrong("a name without an end"))?;
        let line = self.text(length)?;
        self.at += 1;
        Ok(line)
    }

    fn push(&mut self, object: Object) {
        let id = self.arena.add(object);
        self.stack.push(id);
    }

    fn pop(&mut self) -> Result<Id, Problem> {
        let floor = self.marks.last().copied().unwrap_or(0);
        if self.stack.len() <= floor {
            return Err(self.wrong("an instruction finds nothing to work on"));
        }
        self.stack.pop().ok_or_else(|| self.wrong("an instruction finds nothing to work on"))
    }

    fn pop_to_mark(&mut self) -> Result<Vec<Id>, Problem> {
        let mark = self.marks.pop().ok_or_else(|| self.wrong("an instruction finds no mark"))?;
        Ok(self.stack.split_off(mark))
    }

    fn top(&self) -> Result<Id, Problem> {
        self.stack.last().copied().ok_or_else(|| self.wrong("an instruction finds nothing to work on"))
    }

    fn remember(&mut self, place: u32) -> Result<(), Problem> {
        let top = self.top()?;
        self.memo.insert(place, top);
        Ok(())
    }

    fn recall(&mut self, place: u32) -> Result<(), Problem> {
        let id =
            self.memo.get(&place).copied().ok_or_else(|| self.wrong(format!("nothing is remembered as {place}")))?;
        self.stack.push(id);
        Ok(())
    }

    fn tuple(&mut self, length: usize) -> Result<(), Problem> {
        let mut items = (0..length).map(|_| self.pop()).collect::<Result<Vec<_>, _>>()?;
        items.reverse();
        self.push(Object::Tuple(items));
        Ok(())
    }

    fn append(&mut self, items: Vec<Id>) -> Result<(), Problem> {
        let top = self.top()?;
        match &mut self.arena.objects[top] {
            Object::List(list) => list.extend(items),
            _ => return Err(self.wrong("something is appended to an object that is no list")),
        }
        Ok(())
    }

    fn set(&mut self, items: &[Id]) -> Result<(), Problem> {
        let top = self.top()?;
        match &mut self.arena.objects[top] {
            Object::Dict(entries) => entries.extend(items.as_chunks::<2>().0.iter().map(|[key, value]| (*key, *value))),
            _ => return Err(self.wrong("an entry is set in an object that is no dictionary")),
        }
        Ok(())
    }

    fn step(&mut self, instruction: u8, at: usize) -> Result<(), Problem> {
        match instruction {
            // The protocol, and the length of a frame: not needed.
            0x80 => drop(self.take(1)?),
            0x95 => drop(self.take(8)?),
            b'(' => self.marks.push(self.stack.len()),
            b'N' => self.push(Object::Nothing),
            0x88 => self.push(Object::Bool(true)),
            0x89 => self.push(Object::Bool(false)),
            b'J' => {
                let number = self.unsigned(4)? as u32 as i32;
                self.push(Object::Integer(number.into()));
            }
            b'K' | b'M' => {
                let number = self.unsigned(if instruction == b'K' { 1 } else { 2 })?;
                self.push(Object::Integer(number as i64));
            }
            0x8a => self.long()?,
            b'G' => {
                self.take(8)?;
                self.push(Object::Float);
            }
            // Texts, with their length in one, four or eight bytes.
            b'X' | b'T' | b'B' | b'U' | b'C' | 0x8c | 0x8d => {
                let width = match instruction {
                    b'U' | b'C' | 0x8c => 1,
                    0x8d => 8,
                    _ => 4,
                };
                let length = self.unsigned(width)?;
                let text = self.text(length)?;
                self.push(Object::Text(text));
            }
            b')' => self.push(Object::Tuple(Vec::new())),
            0x85..=0x87 => self.tuple(usize::from(instruction - 0x84))?,
            b't' => {
                let items = self.pop_to_mark()?;
                self.push(Object::Tuple(items));
            }
            b']' => self.push(Object::List(Vec::new())),
            b'}' => self.push(Object::Dict(Vec::new())),
            b'a' => {
                let item = self.pop()?;
                self.append(vec![item])?;
            }
            b'e' => {
                let items = self.pop_to_mark()?;
                self.append(items)?;
            }
            b's' => {
                let (value, key) = (self.pop()?, self.pop()?);
                self.set(&[key, value])?;
            }
            b'u' => {
                let items = self.pop_to_mark()?;
                self.set(&items)?;
            }
            b'q' | b'r' => {
                let place = self.unsigned(if instruction == b'q' { 1 } else { 4 })?;
                self.remember(place as u32)?;
            }
            0x94 => self.remember(self.memo.len() as u32)?,
            b'h' | b'j' => {
                let place = self.unsigned(if instruction == b'h' { 1 } else { 4 })?;
                self.recall(place as u32)?;
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.global(&module, &name)?;
            }
            0x93 => {
                let (name, module) = (self.pop()?, self.pop()?);
                let (Object::Text(module), Object::Text(name)) = (self.arena.get(module), self.arena.get(name)) else {
                    return Err(self.wrong("a global without a name"));
                };
                let (module, name) = (module.clone(), name.clone());
                self.global(&module, &name)?;
            }
            b'Q' => self.storage()?,
            b'R' => self.reduce()?,
            // A state dict's `_metadata`: versions of modules.
            b'b' => drop(self.pop()?),
            other => {
                self.at = at;
                return Err(self.wrong(format!("instruction {other:#04x} has no place in a state dict")));
            }
        }
        Ok(())
    }

    /// A long integer.
    fn long(&mut self) -> Result<(), Problem> {
        let length = self.unsigned(1)?;
        let bytes = self.take(length)?;
        let negative = bytes.last().is_some_and(|last| last & 0x80 != 0);
        let mut low = if negative { [0xff; 8] } else { [0; 8] };
        let kept = length.min(8);
        low[..kept].copy_from_slice(&bytes[..kept]);
        self.push(Object::Integer(i64::from_le_bytes(low)));
        Ok(())
    }

    /// Known names. Any other is refused before anything is done with it.
    fn global(&mut self, module: &str, name: &str) -> Result<(), Problem> {
        let object = match (module, name) {
            ("collections", "OrderedDict") => Object::Function(Function::OrderedDict),
            ("torch", "Size") => Object::Function(Function::Size),
            ("torch._utils", "_rebuild_tensor_v2" | "_rebuild_tensor") => Object::Function(Function::RebuildTensor),
            ("torch._utils", "_rebuild_parameter") => Object::Function(Function::RebuildParameter),
            ("torch" | "torch.storage", class) if Scalar::of_class(class).is_some() => {
                Object::StorageClass(Scalar::of_class(class).expect("just looked up"))
            }
            _ => {
                let short = |text: &str| text.chars().take(60).collect::<String>();
                let (module, name) = (short(module), short(name));
                return Err(self.wrong(format!(
                    "it names `{module}.{name}`, which has no place in a state dict; nothing of it was executed"
                )));
            }
        };
        self.push(object);
        Ok(())
    }

    /// `('storage', class, key, device, count)`, with a sixth part in old files.
    fn storage(&mut self) -> Result<(), Problem> {
        let id = self.pop()?;
        let parts = match self.arena.get(id) {
            Object::Tuple(parts) if (5..=6).contains(&parts.len()) => parts.clone(),
            _ => return Err(self.wrong("a reference to something that is no storage")),
        };
        let (Object::StorageClass(scalar), Object::Text(key)) = (self.arena.get(parts[1]), self.arena.get(parts[2]))
        else {
            return Err(self.wrong("a storage without a type or a key"));
        };
        if let Some(view) = parts.get(5)
            && !matches!(self.arena.get(*view), Object::Nothing)
        {
            return Err(self.wrong("a storage that is a view into another one"));
        }
        let (key, scalar) = (key.clone(), *scalar);
        self.charge(key.len())?;
        self.arena.sizes.insert(key.clone(), scalar.size());
        self.push(Object::Storage { key, scalar });
        Ok(())
    }

    /// The result of a function that Python would call, made from the arguments alone.
    fn reduce(&mut self) -> Result<(), Problem> {
        let (arguments, function) = (self.pop()?, self.pop()?);
        let (Object::Function(function), Object::Tuple(arguments)) =
            (self.arena.get(function), self.arena.get(arguments))
        else {
            return Err(self.wrong("a call of something that is no function"));
        };
        let (function, arguments) = (*function, arguments.clone());
        let length = |id: &Id| match self.arena.get(*id) {
            Object::Tuple(items) | Object::List(items) => items.len(),
            Object::Storage { key, .. } => key.len(),
            Object::Tensor(view) => view.storage.len() + 2 * view.shape.len(),
            _ => 0,
        };
        let copied = arguments.len() + arguments.iter().map(length).sum::<usize>();
        self.charge(copied)?;
        let object = match function {
            Function::OrderedDict => {
                let pairs = match arguments.first().map(|id| self.arena.get(*id)) {
                    Some(Object::List(pairs)) => pairs.clone(),
                    _ => Vec::new(),
                };
                let pair = |id: &Id| match self.arena.get(*id) {
                    Object::Tuple(pair) | Object::List(pair) if pair.len() == 2 => Some((pair[0], pair[1])),
                    _ => None,
                };
                Object::Dict(pairs.iter().filter_map(pair).collect())
            }
            Function::Size => Object::Tuple(match arguments.first().map(|id| self.arena.get(*id)) {
                Some(Object::Tuple(sides) | Object::List(sides)) => sides.clone(),
                _ => Vec::new(),
            }),
            Function::RebuildParameter => match arguments.first().map(|id| self.arena.get(*id)) {
                Some(Object::Tensor(view)) => Object::Tensor(view.clone()),
                _ => return Err(self.wrong("a parameter that is no tensor")),
            },
            Function::RebuildTensor => {
                let view = match arguments[..] {
                    [storage, offset, shape, strides, ..] => self.view(storage, offset, shape, strides),
                    _ => None,
                };
                Object::Tensor(view.ok_or_else(|| self.wrong("a tensor without storage, shape or strides"))?)
            }
        };
        self.push(object);
        Ok(())
    }

    fn view(&self, storage: Id, offset: Id, shape: Id, strides: Id) -> Option<View> {
        let Object::Storage { key, scalar } = self.arena.get(storage) else { return None };
        let (offset, shape) = (self.arena.integer(offset)?, self.arena.integers(shape)?);
        let strides = self.arena.integers(strides)?;
        Some(View { storage: key.clone(), scalar: *scalar, offset, shape, strides })
    }
}
