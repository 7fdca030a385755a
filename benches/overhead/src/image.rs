//! The program as it was linked: the instructions of its functions.

use std::collections::HashMap;
use std::error::Error;
use std::fs;

use iced_x86::{Code, Decoder, DecoderOptions, Instruction, Mnemonic};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

/// The functions of a program, by name.
pub struct Image {
    functions: HashMap<String, Function>,
    names: HashMap<u64, String>,
}

struct Function {
    address: u64,
    bytes: Vec<u8>,
}

/// What one function does.
pub struct Listing {
    /// Its instructions, in order; what only fills up lines of memory is left out.
    pub instructions: Vec<Instruction>,
}

impl Image {
    /// Of the program that runs.
    ///
    /// # Errors
    /// It cannot be read, or is of a machine that this does not know.
    pub fn of_this_program() -> Result<Self, Box<dyn Error>> {
        let data = fs::read(std::env::current_exe()?)?;
        let file = object::File::parse(&*data)?;
        if file.architecture() != object::Architecture::X86_64 {
            return Err(
                format!("instructions of {:?} are not known here, only those of x86-64", file.architecture()).into()
            );
        }
        let (mut functions, mut names) = (HashMap::new(), HashMap::new());
        for symbol in file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0) {
            let Some(section) = symbol.section_index().and_then(|index| file.section_by_index(index).ok()) else {
                continue;
            };
            let Some(bytes) = section.data_range(symbol.address(), symbol.size())? else { continue };
            let name = format!("{:#}", rustc_demangle::demangle(symbol.name()?));
            names.entry(symbol.address()).or_insert_with(|| name.clone());
            functions.insert(name, Function { address: symbol.address(), bytes: bytes.to_vec() });
        }
        Ok(Self { functions, names })
    }

    /// The instructions of a function; those of another where it is only a name for it, because the linker or the compiler
    /// found both to be the same.
    ///
    /// # Errors
    /// There is no such function.
    pub fn listing(&self, name: &str) -> Result<Listing, Box<dyn Error>> {
        let function =
            self.functions.get(name).ok_or_else(|| format!("there is no function {name} in this program"))?;
        let decoder = Decoder::with_ip(64, &function.bytes, function.address, DecoderOptions::NONE);
        let fills = |one: &Instruction| matches!(one.mnemonic(), Mnemonic::Nop | Mnemonic::Int3);
        Ok(Listing { instructions: decoder.into_iter().filter(|one| !fills(one)).collect() })
    }

    /// The same; where a function does nothing but jump to another, what that does.
    ///
    /// # Errors
    /// There is no such function.
    pub fn followed(&self, name: &str) -> Result<Listing, Box<dyn Error>> {
        let listing = self.listing(name)?;
        match listing.instructions[..] {
            [jump] if jump.is_jmp_short_or_near() => match self.names.get(&jump.near_branch_target()) {
                Some(target) => self.listing(target),
                None => Ok(listing),
            },
            _ => Ok(listing),
        }
    }
}

impl Listing {
    /// How many instructions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.instructions.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.instructions.is_empty()
    }

    /// The instructions without registers, labels and addresses.
    #[must_use]
    pub fn codes(&self) -> Vec<Code> {
        self.instructions.iter().map(Instruction::code).collect()
    }

    /// How many of them compute with several numbers at once, and how many with one.
    #[must_use]
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
