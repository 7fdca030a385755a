//! The linked program: the instructions of its functions.

use std::collections::HashMap;
use std::error::Error;
use std::fs;

use iced_x86::{Code, Decoder, DecoderOptions, FlowControl, Instruction, Mnemonic};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

/// The functions of a program, by address.
pub struct Image {
    functions: HashMap<u64, Function>,
    /// Difference between the address of the program in memory and the address in its file.
    bias: u64,
}

struct Function {
    name: String,
    bytes: Vec<u8>,
}

/// The disassembly of one function.
pub struct Listing {
    /// The instructions in order, without padding.
    pub instructions: Vec<Instruction>,
    /// Calls and jumps out of the function: the name of the target, if it is a function of this program.
    pub leaves_for: Vec<Option<String>>,
}

/// A unique function, whose address determines the load address of the program.
#[inline(never)]
fn anchor() -> &'static str {
    std::hint::black_box("overhead::image::anchor")
}

impl Image {
    /// Reads the running program.
    ///
    /// # Errors
    /// Returns an error if the program cannot be read, or is not for x86-64.
    pub fn of_this_program() -> Result<Self, Box<dyn Error>> {
        let data = fs::read(std::env::current_exe()?)?;
        let file = object::File::parse(&*data)?;
        if file.architecture() != object::Architecture::X86_64 {
            return Err(
                format!("instructions of {:?} are not known here, only those of x86-64", file.architecture()).into()
            );
        }
        let (mut functions, mut bias) = (HashMap::new(), None);
        for symbol in file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0) {
            let Some(section) = symbol.section_index().and_then(|index| file.section_by_index(index).ok()) else {
                continue;
            };
            let Some(bytes) = section.data_range(symbol.address(), symbol.size())? else { continue };
            let name = format!("{:#}", rustc_demangle::demangle(symbol.name()?));
            if name == anchor() {
                bias = Some((anchor as *const () as u64).wrapping_sub(symbol.address()));
            }
            functions.insert(symbol.address(), Function { name, bytes: bytes.to_vec() });
        }
        let bias = bias.ok_or("this program has no names of functions: it was stripped")?;
        Ok(Self { functions, bias })
    }

    /// Returns the instructions of a function.
    ///
    /// # Errors
    /// Returns an error if there is no function at this address.
    pub fn listing(&self, function: *const ()) -> Result<Listing, Box<dyn Error>> {
        let address = (function as u64).wrapping_sub(self.bias);
        self.at(address).ok_or_else(|| format!("there is no function at {address:#x} in this program").into())
    }

    fn at(&self, address: u64) -> Option<Listing> {
        let bytes = &self.functions.get(&address)?.bytes;
        let decoder = Decoder::with_ip(64, bytes, address, DecoderOptions::NONE);
        let fills = |one: &Instruction| matches!(one.mnemonic(), Mnemonic::Nop | Mnemonic::Int3);
        let instructions: Vec<Instruction> = decoder.into_iter().filter(|one| !fills(one)).collect();
        let inside = address..address + bytes.len() as u64;
        let leaves = instructions.iter().filter_map(|one| match one.flow_control() {
            FlowControl::Call | FlowControl::UnconditionalBranch | FlowControl::ConditionalBranch => {
                let target = one.near_branch_target();
                (!inside.contains(&target)).then(|| self.functions.get(&target).map(|function| function.name.clone()))
            }
            FlowControl::IndirectCall | FlowControl::IndirectBranch => Some(None),
            _ => None,
        });
        // Several conditional branches may jump to the same function.
        let mut leaves_for: Vec<Option<String>> = leaves.collect();
        leaves_for.sort_unstable();
        leaves_for.dedup_by(|a, b| a.is_some() && a == b);
        Some(Listing { instructions, leaves_for })
    }

    /// Returns the instructions of a function. If it only jumps to one of `others`, because the compiler found both to
    /// be identical, returns the instructions of that one.
    ///
    /// # Errors
    /// Returns an error if there is no function at this address.
    pub fn followed(&self, function: *const (), others: &[*const ()]) -> Result<Listing, Box<dyn Error>> {
        let listing = self.listing(function)?;
        if let [jump] = listing.instructions[..]
            && jump.mnemonic() == Mnemonic::Jmp
        {
            let target = jump.near_branch_target().wrapping_add(self.bias);
            if others.iter().any(|&other| other as u64 == target) {
                return self.listing(target as *const ());
            }
        }
        Ok(listing)
    }
}

impl Listing {
    /// Returns the number of instructions.
    pub fn len(&self) -> usize {
        self.instructions.len()
    }

    /// Returns whether there are no instructions.
    pub fn is_empty(&self) -> bool {
        self.instructions.is_empty()
    }

    /// Returns the instructions without registers, labels and addresses.
    pub fn codes(&self) -> Vec<Code> {
        self.instructions.iter().map(Instruction::code).collect()
    }

    /// Returns the numbers of instructions that compute with several numbers at once, and with one.
    pub fn arithmetic(&self) -> (usize, usize) {
        use Mnemonic::{
            Addpd, Addsd, Divpd, Divsd, Mulpd, Mulsd, Sqrtpd, Sqrtsd, Subpd, Subsd, Vaddpd, Vaddsd, Vfmadd132pd,
            Vfmadd132sd, Vfmadd213pd, Vfmadd213sd, Vfmadd231pd, Vfmadd231sd, Vmulpd, Vmulsd, Vsqrtpd, Vsqrtsd, Vsubpd,
            Vsubsd,
        };
        let of = |all: &[Mnemonic]| self.instructions.iter().filter(|one| all.contains(&one.mnemonic())).count();
        let packed = [
            Addpd,
            Subpd,
            Mulpd,
            Divpd,
            Sqrtpd,
            Vaddpd,
            Vsubpd,
            Vmulpd,
            Vsqrtpd,
            Vfmadd132pd,
            Vfmadd213pd,
            Vfmadd231pd,
        ];
        let single = [
            Addsd,
            Subsd,
            Mulsd,
            Divsd,
            Sqrtsd,
            Vaddsd,
            Vsubsd,
            Vmulsd,
            Vsqrtsd,
            Vfmadd132sd,
            Vfmadd213sd,
            Vfmadd231sd,
        ];
        (of(&packed), of(&single))
    }
}
