//! The Fortran module: an interface block of every function, its constants and its one structure.

use std::error::Error;
use std::fmt::Write;

use syn::{Expr, FnArg, Item, ItemFn, ItemStruct, Lit, Pat, ReturnType, Type};

const HEAD: &str = "! The linear-algebra abstraction LAS of the crate biotissue, for Fortran 2018. Made by tools/headers.\n!\n\
    ! A function returns LAS_OK or what was wrong; las_text() says it in words. Indices count from 0, as in C; the\n    ! header las.h says what a caller promises.\n\
    ! Which backends there are, the features of the build decide. On `batched` an entry is four numbers, one a lane.\n\
    module biotissue_las\n  use, intrinsic :: iso_c_binding\n  implicit none\n  public\n\n";

const TAIL: &str = "\n  interface\n    function las_strlen(text) bind(c, name=\"strlen\") result(length)\n      \
    import :: c_ptr, c_size_t\n      type(c_ptr), value :: text\n      integer(c_size_t) :: length\n    \
    end function\n  end interface\n\ncontains\n\n  \
    !> What went wrong in the last call that did not return LAS_OK.\n  function las_text() result(text)\n    \
    character(len=:), allocatable :: text\n    character(kind=c_char), pointer :: chars(:)\n    \
    type(c_ptr) :: message\n    integer :: k\n    message = las_message()\n    \
    call c_f_pointer(message, chars, [las_strlen(message)])\n    \
    allocate (character(len=size(chars)) :: text)\n    do k = 1, size(chars)\n      text(k:k) = chars(k)\n    \
    end do\n  end function\nend module\n";

pub fn module(common: &str, parts: &[(&str, String)]) -> Result<String, Box<dyn Error>> {
    let mut text = String::from(HEAD);
    let items = syn::parse_file(common)?.items;
    for item in &items {
        match item {
            Item::Const(constant) => {
                if let Expr::Lit(value) = &*constant.expr
                    && let Lit::Int(value) = &value.lit
                {
                    writeln!(text, "  integer(c_int), parameter :: {} = {value}", constant.ident)?;
                }
            }
            Item::Struct(structure) if structure.ident == "las_params" => fields(&mut text, structure)?,
            _ => {}
        }
    }
    text += "\n  interface\n";
    functions(&mut text, &items, "")?;
    for (name, part) in parts {
        writeln!(text, "\n    ! {name}")?;
        functions(&mut text, &syn::parse_file(part)?.items, name)?;
    }
    Ok(text + "  end interface\n" + TAIL)
}

fn fields(text: &mut String, structure: &ItemStruct) -> Result<(), Box<dyn Error>> {
    writeln!(text, "\n  !> How a system is to be solved.\n  type, bind(c) :: {}", structure.ident)?;
    for field in &structure.fields {
        let name = field.ident.as_ref().ok_or("a field without a name")?;
        writeln!(text, "    {} :: {name}", plain(&field.ty)?)?;
    }
    Ok(writeln!(text, "  end type")?)
}

fn functions(text: &mut String, items: &[Item], backend: &str) -> Result<(), Box<dyn Error>> {
    for item in items {
        if let Item::Fn(function) = item
            && function.sig.abi.is_some()
        {
            self::function(text, function, backend)?;
        }
    }
    Ok(())
}

fn function(text: &mut String, function: &ItemFn, backend: &str) -> Result<(), Box<dyn Error>> {
    let name = function.sig.ident.to_string();
    let mut arguments = Vec::new();
    for argument in &function.sig.inputs {
        let FnArg::Typed(argument) = argument else { return Err("self".into()) };
        let Pat::Ident(pattern) = &*argument.pat else { return Err("a pattern".into()) };
        let argument_name = pattern.ident.to_string();
        let declared = declaration(&argument_name, &argument.ty, backend)?;
        arguments.push((argument_name, declared));
    }
    let names: Vec<&str> = arguments.iter().map(|(name, _)| name.as_str()).collect();
    let result = match &function.sig.output {
        ReturnType::Type(_, of) if matches!(&**of, Type::Ptr(_)) => "type(c_ptr)",
        _ => "integer(c_int)",
    };
    writeln!(text, "    function {name}({}) bind(c) &\n        result(outcome)", names.join(", &\n        "))?;
    writeln!(text, "      import :: c_int, c_double, c_ptr, c_char, las_params")?;
    for (_, declared) in &arguments {
        writeln!(text, "      {declared}")?;
    }
    Ok(writeln!(text, "      {result} :: outcome\n    end function")?)
}

/// A type that is passed as it is.
fn plain(of: &Type) -> Result<&'static str, Box<dyn Error>> {
    match name_of(of).as_deref() {
        Some("i32") => Ok("integer(c_int)"),
        Some("f64") => Ok("real(c_double)"),
        other => Err(format!("no Fortran for {other:?}").into()),
    }
}

fn name_of(of: &Type) -> Option<String> {
    let Type::Path(path) = of else { return None };
    path.path.segments.last().map(|segment| segment.ident.to_string())
}

fn declaration(name: &str, of: &Type, backend: &str) -> Result<String, Box<dyn Error>> {
    let Type::Ptr(pointer) = of else { return Ok(format!("{}, value :: {name}", plain(of)?)) };
    let writes = pointer.mutability.is_some();
    if let Type::Ptr(_) = &*pointer.elem {
        let (intent, size) = if writes { ("out", "") } else { ("in", "(*)") };
        return Ok(format!("type(c_ptr), intent({intent}) :: {name}{size}"));
    }
    let of = name_of(&pointer.elem).ok_or("a pointer to something without a name")?;
    Ok(match (of.as_str(), writes) {
        ("las_params", true) => format!("type(las_params), intent(out) :: {name}"),
        ("las_params", false) => format!("type(las_params), intent(in) :: {name}"),
        ("c_char", _) => format!("character(kind=c_char), intent(in) :: {name}(*)"),
        ("f64", true) if name == "residual" => format!("real(c_double), intent(out), optional :: {name}"),
        ("i32", true) if name == "iterations" => format!("integer(c_int), intent(out), optional :: {name}"),
        ("i32", true) => format!("integer(c_int), intent(out) :: {name}"),
        ("i32", false) => format!("integer(c_int), intent(in) :: {name}(*)"),
        ("f64", true) if ["norm", "dot"].contains(&name) && backend != "batched" => {
            format!("real(c_double), intent(out) :: {name}")
        }
        ("f64", true) => format!("real(c_double), intent(inout) :: {name}(*)"),
        ("f64", false) => format!("real(c_double), intent(in) :: {name}(*)"),
        _ => format!("type(c_ptr), value :: {name}"),
    })
}
